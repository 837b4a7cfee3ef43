"""The fat: tetrahedra between the neutral inner layers and the skin, and what holds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import under_fat
from handpipe.hand import read_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.tissues.tissue import Inside, make_tissue
from handpipe.tissues.fat import Skin, TissueSettings, inner_surface

SPACING, GAP = 0.8, 1.0  # mm of the grid, and that are closed between organs


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    skin: Path


def mesh_fat(inputs: Inputs, output: Path, edge: float, on: Sequence[str] = under_fat()) -> None:
    """The fat: tetrahedra between the neutral inner layers and the skin, and what holds them.

    edge: of the tets, in mm; on: the layers whose bodies the fat lies on.
    """
    rig = Rig.load(inputs.rig)
    [(_, below)] = read_frames(inputs.inner)
    bodies = [
        Surface(s.vertices, s.cells) for n in on for s in below.get(n, {}).values() if s.cells.shape[1] == 3
    ]
    inner = inner_surface(bodies, spacing=SPACING, gap=GAP)
    inside = Inside(below, tuple(on), inner, inputs.inner)
    tissue = make_tissue(rig, inside, Skin.load(inputs.skin), edge, TissueSettings())
    tissue.save(output, [inputs.inner, inputs.skin])
