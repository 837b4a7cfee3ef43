"""A toy limb: two bones in a row inside a skin, and a muscle from one to the other."""

from tests.anatomy.arm import capsule

from handpipe.mesh.surfaces.surface import Surface


def elbow(edge_length: float) -> tuple[Surface, dict[str, Surface]]:
    """The skin, 100 mm long, and two bones of 38 mm that are 4 mm apart in the middle."""
    skin = capsule(-30.0, 30.0, 20.0, edge_length)
    bones = {"humerus": (-35.0, -7.0), "radius": (7.0, 35.0)}
    return skin, {name: capsule(*ends, 5.0, 3.0) for name, ends in bones.items()}


TWO_MUSCLES = """
units: mm
distal: [1, 0, 0]
fat: 0.3
muscles:
  flexor:
    curves:
      - points:
          - {bone: humerus, along: 0.2, towards: [0, 0, -1], tissue: 1}
          - {at: [0, 0, -11], tissue: 1.5}
          - {bone: radius, along: 0.8, towards: [0, 0, -1], tissue: 1}
  extensor:
    curves:
      - points:
          - {bone: humerus, along: 0.2, towards: [0, 0, 1], tissue: 1}
          - {at: [0, 0, 11], tissue: 1.5}
          - {bone: radius, along: 0.8, towards: [0, 0, 1], tissue: 1}
"""
