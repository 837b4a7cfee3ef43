"""The skin of a scanned pose by simpler models than those of Zheng 2022 Table 4."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import Array, RigidTransform, Shape, Shapes
from handpipe.hand import read_frames, write_frames
from handpipe.skeleton.posing import blend, blend_linearly
from handpipe.skeleton.rig import Rig, pivoted
from handpipe.stages.files import Files
from handpipe.tissues.fat import FatStrains, Tissue, TissueLayer


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    soft_tissue: Path
    strains: Path


def simulate_baselines(inputs: Inputs, output: Path) -> None:
    """The skin of a scanned pose by simpler models than those of Zheng 2022 Table 4.

    m3 is one soft tissue around the bones with plastic strains fitted in every example pose (Ichim 2017).
    "linear" and "dual_quaternion" blend the bones' motions (Wang 2019 Fig. 17); "pivot" does so too, with
    bones that turn about the heads of their parents (Wang 2019 Fig. 20).
    """
    [(frame, below)] = read_frames(inputs.inner)
    tissue, strains = Tissue.load(inputs.soft_tissue), FatStrains.load(inputs.strains)
    strains.require_mesh(tissue.mesh, inputs.strains)
    layer = TissueLayer("skin", tissue, strains).lenient()
    weights = tissue.skin_matrix @ tissue.weights

    def shape(vertices: Array) -> Shapes:
        return {"skin": Shape(tissue.skin.vertices, vertices, tissue.skin.triangles)}

    def ordered(bones: Mapping[str, RigidTransform]) -> dict[str, RigidTransform]:
        return {bone: bones[bone] for bone in tissue.bones}

    rest, bones = tissue.skin.vertices, ordered(frame.bones)
    rig = Rig.load(inputs.rig)
    skins = {
        "m3": layer.solve(frame, below),
        "dual_quaternion": shape(blend(rest, weights, bones)),
        "linear": shape(blend_linearly(rest, weights, bones)),
        "pivot": shape(blend(rest, weights, ordered(pivoted(rig, frame.bones)))),
    }
    write_frames(output, [(frame, skins)], inputs.all())
