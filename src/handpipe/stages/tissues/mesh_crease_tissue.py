"""One soft tissue with creases between the bones and the skin (Wang 2019 §5)."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from handpipe.core import BoolArray, Frame, Region, Shape, Shapes
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.posing import FACING, BoneLayer, smoothed_weights, swept_vertices
from handpipe.skeleton.rig import Rig, hand_directions
from handpipe.stages.files import Files
from handpipe.stages.tissues.tissue import require_inside
from handpipe.tissues.fascia import bone_wrap
from handpipe.tissues.fat import Rigid, Skin, Tissue, TissueSettings, inner_points
from handpipe.tissues.fat.creases import creases_of, folding_vertices, graded_mesh

log = logging.getLogger(__name__)

BONE_EDGE = 1.5  # mm, of the inner surface; with 2.5 (Wang 2019 §5.3) a quarter of a thin bone is lost
STEP = np.radians(5.0)  # of the sweep through the ranges of motion; Wang 2019: 1 degree
STIFFNESS = 200.0  # kPa/mm, of constraints
YOUNG, POISSON = 6.0, 0.495  # kPa: the skin's barrier is as stiff as five times its back's tissue


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    skin: Path


@dataclass(frozen=True)
class CreaseEdges:
    """Edge lengths in mm: of the skin where it folds and elsewhere, and of tets far from both surfaces."""

    fine: float
    coarse: float
    deep: float


def mesh_crease_tissue(inputs: Inputs, output: Path, dataset: Dataset, edges: CreaseEdges) -> None:
    """One soft tissue with creases between the bones and the skin (Wang 2019 §5)."""
    rig = Rig.load(inputs.rig)
    skin = Skin.load(inputs.skin).with_ends(rig.surfaces)
    bones = {name: Shape(s.vertices, s.vertices, s.triangles) for name, s in rig.surfaces.items()}
    require_inside({"bones": bones}, skin, inputs.rig)
    crease_tissue(rig, skin, dataset.hand, edges).save(output, inputs.all())


def crease_tissue(rig: Rig, skin: Skin, hand: Literal["right", "left"], edges: CreaseEdges) -> Tissue:
    """The tissue of a rig and a neutral skin."""
    folding = folding_vertices(skin.surface, rig)
    inner = bone_wrap(rig.surfaces, [(j.parent, j.child) for j in rig.joints], BONE_EDGE, FACING)
    mesh, outer = graded_mesh(skin.surface, folding, inner, edges.fine, edges.coarse, edges.deep)
    on_outer = _marked_on(outer, skin.surface, folding, corners=1)
    points = inner_points({"bones": swept_bones(rig)}, ("bones",), inner, slack=0.25)
    directions = hand_directions(rig, hand)
    creases = creases_of(mesh, outer, on_outer, rig, None if directions is None else directions.dorsal)
    log.info("%d vertices, %d tets, %d inner points", len(mesh.vertices), len(mesh.tets), len(points.rest))
    return Tissue(
        mesh,
        np.ones(len(mesh.tets)),
        outer,
        points,
        {name: _on(part, skin.surface, outer) for name, part in skin.rigid.items()},
        tuple(rig.surfaces),
        smoothed_weights(mesh, rig.surfaces),
        TissueSettings(YOUNG, POISSON, STIFFNESS),
        creases=creases,
        parents=rig.parents,
    )


def swept_bones(rig: Rig) -> Shapes:
    """The neutral bones with the regions that hold the tissue: fixed, but for joints and swept faces.

    Near another bone (4 mm) and on the faces over which a child glides, the tissue is in contact only.
    """
    rest = dict.fromkeys(rig.angle_names, 0.0)
    shapes = BoneLayer(rig.surfaces).solve(Frame("neutral", rest, rig.bone_transforms(rest)), {})
    swept = swept_vertices(rig, STEP)
    return {
        name: replace(shape, fields={"region": np.where(swept[name], Region.contact, shape.fields["region"])})
        for name, shape in shapes.items()
    }


def _marked_on(other: Surface, surface: Surface, marked: BoolArray, corners: int) -> BoolArray:
    """Vertices (n,) of another mesh of a surface that lie in triangles with so many marked corners."""
    triangles = Distance(surface).closest(other.vertices)[1]
    found: BoolArray = marked[surface.triangles[triangles]].sum(axis=1) >= corners
    return found


def _on(part: Rigid, surface: Surface, outer: Surface) -> Rigid:
    """A rigid part of the skin on the skin as it was remeshed."""
    marked = np.isin(np.arange(len(surface.vertices)), part.vertices)
    return Rigid(part.bone, np.flatnonzero(_marked_on(outer, surface, marked, corners=2)))
