"""A small limb with every layer: two bones at a hinge, two muscles, two tendons, a ligament, fasciae, fat."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from benchmarks.layered.subject import Subject
from tests.tissues.fat.limb import capsule
from tests.tissues.muscles.shapes import hinge, hinge_bones, spindle

from handpipe.core.layer_registry import under_fat
from handpipe.core.layers import Frame, Shapes
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.posing.layer import BoneLayer, bone_regions
from handpipe.skeleton.posing.local_pose_spaces import LocalPoseSpaces
from handpipe.skeleton.posing.skinning import smoothed_weights
from handpipe.tissues.fascia.fascia import ClothSettings, Fascia
from handpipe.tissues.fascia.regions import muscle_regions
from handpipe.tissues.fascia.wrapping import bone_wrap, wrap
from handpipe.tissues.fat.constraints import inner_points
from handpipe.tissues.fat.layer import FatStrains
from handpipe.tissues.fat.mesh import inner_surface, skin_share, tissue_mesh
from handpipe.tissues.fat.skin import Rigid
from handpipe.tissues.fat.tissue import Tissue, TissueSettings
from handpipe.tissues.muscles.muscle import Examples, Muscle
from handpipe.tissues.tendons.rods.rest import RestTendon
from handpipe.tissues.tendons.tendon import RegisteredRods, build_tendon

PARENTS = {"b": "a"}
LIMITS = {"hinge_flexion": (-0.1, 0.5)}  # rad
STILL = {bone: RigidTransform.identity() for bone in "ab"}
SKIN_EDGE, FAT_EDGE, CLOTH_EDGE = 5.0, 5.0, 3.0  # mm


def limb(folder: Path) -> Subject:
    """The limb, its artifacts written below a folder."""
    bones = hinge_bones()
    files = {name: [folder / f"{name}.h5"] for name in ("bones", "bone_fascia", "muscle_fascia")}
    files |= {name: [folder / f"{name}-{i}.h5" for i in range(2)] for name in ("tendons", "muscles", "fat")}
    files |= {"ligaments": [folder / "ligament.h5"], "skin": [folder / "skin.h5"]}
    order = ("bones", "bone_fascia", "tendons", "muscles", "muscle_fascia", "ligaments", "fat", "skin")
    subject = Subject(
        {name: files[name] for name in order}, bones, LIMITS, lambda angles: hinge(angles["hinge_flexion"])
    )
    _write_inner(files, bones)
    below: dict[str, Shapes] = {}
    for name in order[:-2]:
        below[name] = subject.load(name).solve(Frame("neutral", {"hinge_flexion": 0.0}, STILL), below)
    _write_outer(files, bones, below)
    return subject


def _write_inner(files: dict[str, list[Path]], bones: dict[str, Surface]) -> None:
    examples = Examples(PARENTS, "neutral", {})
    bodies = {f"muscle{i}": spindle((0.0, 7.5 * i - 3.75, 1.0)) for i in range(2)}
    muscles = [Muscle.fit(name, body, examples, {})[0] for name, body in bodies.items()]
    for muscle, file in zip(muscles, files["muscles"], strict=True):
        muscle.save(file)
    for i, file in enumerate(files["tendons"]):
        x = np.column_stack([np.linspace(18.0, -18.0, 37), np.full(37, 5.0 * i - 2.5), np.full(37, -11.0)])
        rest = RestTendon.build(x, 1.2, {name: bones[name] for name in "ba"})
        known = RegisteredRods({"neutral": x}, {"neutral": STILL}, PARENTS)
        build_tendon(f"tendon{i}", rest, 1.2, bones, known).save(file)
    ligament, _ = Muscle.fit("ligament", spindle((0.0, -9.0, -7.0), edge=4.0), examples, {})
    ligament.save(files["ligaments"][0])
    cloth = ClothSettings(shrink=0.35)
    around_bones = bone_wrap(bones, [("a", "b")], CLOTH_EDGE)
    regions = bone_regions(around_bones.vertices, bones, joint_radius=4.0, tolerance=0.6)
    Fascia.around("bone_fascia", around_bones, regions, bones, cloth).save(files["bone_fascia"][0], [])
    surfaces = {m.name: m.body.surface for m in muscles}
    around = wrap(list(surfaces.values()), CLOTH_EDGE)
    attached = np.concatenate([m.body.surface.vertices[m.body.attached_vertices] for m in muscles])
    of_muscles = muscle_regions(around.vertices, surfaces, attached, attached_radius=2.0, gap=1.0)
    Fascia.around("muscle_fascia", around, of_muscles, surfaces, cloth).save(files["muscle_fascia"][0], [])


def _write_outer(files: dict[str, list[Path]], bones: dict[str, Surface], below: dict[str, Shapes]) -> None:
    shapes = [s for n in under_fat() for s in below[n].values() if s.cells.shape[1] == 3]
    inner = inner_surface([Surface(s.vertices, s.cells) for s in shapes], 0.8, 1.0)
    fat = _tissue(below, under_fat(), inner, bones, TissueSettings())
    fat.save(files["fat"][0], [])
    space = LocalPoseSpaces.build("ab", PARENTS, {"neutral": STILL})
    tets, vertices = len(fat.mesh.tets), len(fat.mesh.vertices)
    FatStrains(space, np.zeros((1, tets, 6)), {}, np.zeros((1, vertices, 3))).save(files["fat"][1], [])
    alone = {"bones": BoneLayer(bones).solve(Frame("neutral", {}, STILL), {})}
    around = bone_wrap(bones, [("a", "b")], CLOTH_EDGE)
    _tissue(alone, ("bones",), around, bones, TissueSettings(young=6.0, skin_young=6.0)).save(
        files["skin"][0], []
    )


def _tissue(
    below: dict[str, Shapes],
    layers: tuple[str, ...],
    inner: Surface,
    bones: dict[str, Surface],
    settings: TissueSettings,
) -> Tissue:
    skin = capsule(17.0, SKIN_EDGE, 34.0)
    skin = skin.moved(skin.vertices - [0.0, 0.0, 4.0])
    mesh, occupancy = tissue_mesh(skin, inner, FAT_EDGE)
    points = inner_points(below, layers, inner, slack=0.25)
    end = {"cut_end": Rigid("a", np.flatnonzero(skin.vertices[:, 0] < -28.0))}
    weights = smoothed_weights(mesh, bones)
    made = Tissue(mesh, occupancy, skin, points, end, ("a", "b"), weights, settings, parents=PARENTS)
    return replace(made, skin_share=skin_share(mesh, skin, inner, 1.5))
