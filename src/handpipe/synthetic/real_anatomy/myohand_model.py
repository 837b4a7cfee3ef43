"""MyoHand, a model of a right hand: its bones, and its joints with axes and ranges, in its rest pose in mm.

In the frame of its placed meshes the hand hangs along -y with the palm towards +x and the thumb towards +z.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.real_anatomy.source_meshes import read_mesh, require

FINGERS = (2, 3, 4, 5)  # rays with three phalanges
BONES = {
    "metacarpal1": "1mc",
    "proximal1": "thumbprox",
    "distal1": "thumbdist",
    **{f"metacarpal{ray}": f"{ray}mc" for ray in FINGERS},
    **{f"proximal{ray}": f"{ray}proxph" for ray in FINGERS},
    **{f"middle{ray}": f"{ray}midph" for ray in FINGERS},
    **{f"distal{ray}": f"{ray}distph" for ray in FINGERS},
    **{name: name for name in ("trapezium", "trapezoid", "capitate", "hamate")},
}
# Our angle: the model's joint, and the sign of its angle. What the model calls abduction of the thumb's first
# joint turns the thumb in the plane of the palm, towards the fingers where the angle falls, and what it calls
# flexion lifts the thumb off that plane: flexion and abduction here.
ANGLES = {
    "TM_flexion": ("cmc_abduction", -1.0),
    "TM_abduction": ("cmc_flexion", 1.0),
    "MP1_flexion": ("mp_flexion", -1.0),
    "IP1_flexion": ("ip_flexion", -1.0),
    **{f"MP{ray}_flexion": (f"mcp{ray}_flexion", 1.0) for ray in FINGERS},
    **{f"MP{ray}_abduction": (f"mcp{ray}_abduction", 1.0) for ray in FINGERS},
    **{f"PIP{ray}_flexion": (f"pm{ray}_flexion", 1.0) for ray in FINGERS},
    **{f"DIP{ray}_flexion": (f"md{ray}_flexion", 1.0) for ray in FINGERS},
}


@dataclass(frozen=True)
class ModelJoint:
    """A hinge: centre (3,) in mm, axis (3,) of about unit length, and least and largest angle in rad."""

    centre: Array
    axis: Array
    limits: tuple[float, float]


def read_bone(folder: Path, bone: str) -> Mesh:
    """The mesh of one of `BONES`, placed, in mm."""
    placed = read_mesh(folder / "rest_pose_m" / f"{BONES[bone]}.ply")
    return Mesh(1000.0 * placed.vertices, placed.triangles)


def read_joints(folder: Path) -> dict[str, ModelJoint]:
    """The model's joints by its own names; `InputError` where the file is absent."""
    path = require(folder / "myohand_body.xml")
    found: dict[str, ModelJoint] = {}

    def visit(body: ElementTree.Element, rotation: Rotation, origin: Array) -> None:
        for joint in body.findall("joint"):
            place, axis = (np.array(joint.get(key, "0 0 0").split(), dtype=float) for key in ("pos", "axis"))
            low, high = (float(limit) for limit in joint.get("range", "0 0").split())
            found[joint.get("name", "")] = ModelJoint(
                1000.0 * (origin + rotation.apply(place)), rotation.apply(axis), (low, high)
            )
        for child in body.findall("body"):
            place = np.array(child.get("pos", "0 0 0").split(), dtype=float)
            turn = Rotation.identity()
            if child.get("euler"):
                turn = Rotation.from_euler("XYZ", np.array(child.get("euler", "").split(), dtype=float))
            elif child.get("quat"):
                turn = Rotation.from_quat(np.roll(np.array(child.get("quat", "").split(), dtype=float), -1))
            visit(child, rotation * turn, origin + rotation.apply(place))

    visit(ElementTree.parse(path).getroot(), Rotation.identity(), np.zeros(3))
    return found


def limits_of(angle: str, joints: dict[str, ModelJoint]) -> tuple[float, float]:
    """Range of one of `ANGLES` in degrees, from the model's zero."""
    name, sign = ANGLES[angle]
    low, high = sorted(sign * np.degrees(np.array(joints[name].limits)))
    return float(low), float(high)
