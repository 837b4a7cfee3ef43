"""The soft organs of Z-Anatomy's right hand, in the neutral frame of its bones.

Of the 17 muscle groups of the template hand the source has 15: its palmar interossei are the little finger's
alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from handpipe.anatomy.templates import OrganSolid
from handpipe.core import RigidTransform
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.real_anatomy.source_meshes import read_mesh
from handpipe.synthetic.real_anatomy.zanatomy_source import HAND


@dataclass(frozen=True)
class Group:
    """A muscle group: its files, the bones at its ends, and which of a file's bodies it is.

    Bodies are counted from the thumb's side outwards; without a number all of them belong to the group.
    """

    files: tuple[str, ...]
    origin: tuple[str, ...]
    insertion: tuple[str, ...]
    body: int | None = None


DORSAL, LUMBRICALS = "Dorsal_interossei_muscles_of_hand_r", "Lumbrical_muscles_of_hand_r"
# Ends after Gray's Anatomy, on the 23 bones: hamate for the pisiform, trapezium for the scaphoid.
GROUPS = {
    "abductor_pollicis_brevis": Group(("Abductor_pollicis_brevis_r",), ("trapezium",), ("proximal1",)),
    "flexor_pollicis_brevis": Group(
        ("Superficial_head_of_flexor_pollicis_brevis_r", "Deep_head_of_flexor_pollicis_brevis_r"),
        ("trapezium",),
        ("proximal1",),
    ),
    "opponens_pollicis": Group(("Opponens_pollicis_muscle_r",), ("trapezium",), ("metacarpal1",)),
    "adductor_pollicis": Group(
        ("Oblique_head_of_adductor_pollicis_r", "Transverse_head_of_adductor_pollicis_r"),
        ("capitate", "metacarpal3"),
        ("proximal1",),
    ),
    "abductor_flexor_digiti_minimi": Group(
        ("Abductor_digiti_minimi_of_hand_r", "Flexor_digiti_minimi_of_hand_r"), ("hamate",), ("proximal5",)
    ),
    "opponens_digiti_minimi": Group(
        ("Opponens_digiti_minimi_muscle_of_hand_r",), ("hamate",), ("metacarpal5",)
    ),
    "dorsal_interosseous1": Group((DORSAL,), ("metacarpal1", "metacarpal2"), ("proximal2",), 0),
    "dorsal_interosseous2": Group((DORSAL,), ("metacarpal2", "metacarpal3"), ("proximal3",), 1),
    "dorsal_interosseous3": Group((DORSAL,), ("metacarpal3", "metacarpal4"), ("proximal3",), 2),
    "dorsal_interosseous4": Group((DORSAL,), ("metacarpal4", "metacarpal5"), ("proximal4",), 3),
    "palmar_interosseous3": Group(("Palmar_interossei_muscles_r",), ("metacarpal5",), ("proximal5",)),
    **{f"lumbrical{i}": Group((LUMBRICALS,), (), (f"proximal{i + 1}",), i - 1) for i in range(1, 5)},
}
LIGAMENTS = tuple(f"collateral_{side}{ray}" for ray in range(1, 6) for side in ("radial", "ulnar"))
ABSENT = ("palmar_interosseous1", "palmar_interosseous2", *LIGAMENTS)
# What only the skin goes round: the bones, tendons and muscles of the wrist and forearm that reach into it.
AROUND = (
    *("Scaphoid_bone_r", "Lunate_bone_r", "Triquetrum_bone_r", "Pisiform_bone_r", "Radius_r", "Ulna_r"),
    *("Flexor_digitorum_profundus_r", "Humero_ulnar_head_of_flexor_digitorum_superficialis_r"),
    *("Flexor_pollicis_longus_r", "Palmaris_longus_muscle_r", "Abductor_pollicis_longus_r"),
    *("Extensor_digitorum_r", "Extensor_indicis_r", "Extensor_digiti_minimi_r"),
    *("Extensor_pollicis_longus_r", "Extensor_pollicis_brevis_r"),
)


def read_organ(folder: Path, file: str, place: RigidTransform) -> Surface:
    """A surface of the source as it is, placed in the neutral frame; `InputError` where it is absent."""
    mesh = read_mesh(folder / HAND / f"{file}.ply")
    return mesh.moved(place(mesh.vertices))


def read_solids(folder: Path, place: RigidTransform) -> dict[str, OrganSolid]:
    """The muscle groups by name, as they are."""
    files = {file: read_organ(folder, file, place) for group in GROUPS.values() for file in group.files}
    return {name: _solid(group, files) for name, group in GROUPS.items()}


def _solid(group: Group, files: Mapping[str, Surface]) -> OrganSolid:
    surfaces = tuple(files[file] for file in group.files)
    if group.body is not None:
        bodies = sorted(surfaces[0].components(), key=lambda body: -float(body.vertices[:, 1].mean()))
        surfaces = (bodies[group.body],)
    return OrganSolid(surfaces, group.origin, group.insertion)
