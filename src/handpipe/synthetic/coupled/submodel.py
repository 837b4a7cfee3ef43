"""A part of a body, attached at the cut to the whole body's solution.

It serves to refine where the whole is too large for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from handpipe.core import Array, BoolArray, IntArray, Metrics, RigidTransform
from handpipe.fem.elements import Material
from handpipe.fem.solver import Options, solve
from handpipe.mesh.tets import tet_neighbours
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody, CoupledPose
from handpipe.synthetic.coupled.validation import difference, solved_from

CUT = "cut"  # takes the place of a bone's name


def cut_out(anatomy: CoupledAnatomy, chosen: BoolArray) -> tuple[CoupledAnatomy, IntArray]:
    """The anatomy of the chosen tets (m,), without strands, and its vertices' (n,) numbers in the whole.

    The vertices of faces between chosen and other tets are like those of a bone named "cut".
    """
    part, used = anatomy.part(chosen)
    tets, (i, j) = anatomy.mesh.tets, tet_neighbours(anatomy.mesh.tets).T
    across = chosen[i] != chosen[j]
    one, other = tets[i[across]], tets[j[across]]
    shared = (one[:, :, None] == other[:, None, :]).any(axis=2)
    bones = {name: on for name, on in part.bones.items() if len(on)}
    bones[CUT] = np.searchsorted(used, np.unique(one[shared]))
    fibres = {name: along for name, along in part.fibres.items() if len(along)}
    return replace(part, bones=bones, fibres=fibres, strands={}), used


@dataclass(frozen=True, eq=False)
class _Carried:
    """Where points of a mesh go with its vertices, from rest to x (n, 3)."""

    elements: Elements
    x: Array

    def __call__(self, points: Array) -> Array:
        return points + self.elements.interpolation(points) @ (self.x - self.elements.nodes)


def refinement_error(
    anatomy: CoupledAnatomy,
    materials: Mapping[str, Material],
    chosen: BoolArray,
    pose: CoupledPose,
    x: Array,
    options: Options | None = None,
) -> Metrics:
    """Difference of linear from quadratic tets on the chosen tets (m,), by `validation.difference`.

    x (n, 3) are positions of the whole anatomy's vertices in the pose, found with linear tets. Both are
    solved with the cut at its positions in x, which excludes differences in the rest of the body.
    """
    part, used = cut_out(anatomy, chosen)
    coarse, fine = (CoupledBody(part, materials, order=1), CoupledBody(part, materials, order=2))
    carried = cast(RigidTransform, _Carried(coarse.elements, x[used]))
    carried_pose = CoupledPose({**pose.bones, CUT: carried}, pose.tensions)
    start = coarse.prescribed(carried_pose, x[used])
    found = solve(coarse.potentials(carried_pose), start, fixed=coarse.fixed, options=options).x
    return difference(coarse, found, fine, solved_from(coarse, found, fine, carried_pose, options))
