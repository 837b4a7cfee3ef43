"""The tissue with creases in a frame: bent in steps from neutral, or from another frame.

Its skin is behind a barrier all the way.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import (
    Array,
    ConvergenceError,
    Frame,
    RigidTransform,
    Shapes,
    SimulatedFrame,
    left_jacobian,
)
from handpipe.fem.contact import Barrier
from handpipe.fem.solver import Settled
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.fat.creases.fold_form import fold_form
from handpipe.tissues.fat.creases.materials import Creases
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.fat.skin_barrier import Scene, behind
from handpipe.tissues.fat.tissue import OPTIONS, Tissue

log = logging.getLogger(__name__)

STEP = np.radians(15.0)  # of the joint that turns most
SMALLEST = 1 / 16  # of a step, below which the frame fails
BRIEF = replace(OPTIONS, displacement_tolerance=0.1, force_tolerance=0.3, saddles=True)  # on the way


class CreaseLayer(TissueLayer):
    """The single soft tissue with creases.

    A fold that a blend of bones makes ends tangled. Bent in steps, sheets of skin meet one another at the
    barrier and never cross.

    Parameters
    ----------
    name : str
        "skin".
    tissue : Tissue
        A tissue with creases.
    strains : FatStrains, optional
        As of `TissueLayer`.
    strict : bool
        As of `TissueLayer`.

    References
    ----------
    Wang 2019 §5.
    """

    def at_rest(self, frame: Frame, below: Mapping[str, Shapes], starts: Sequence[Array]) -> Settled:
        """The equilibrium in a frame, by way of smaller bends; it does not depend on the starts (n, 3).

        Raises
        ------
        ConvergenceError
            Where a step fails, however small.
        """
        tissue = self.tissue
        barrier = tissue.skin_barrier()
        if tissue.creases is None or barrier is None:
            return super().at_rest(frame, below, starts)
        still = dict.fromkeys(frame.bones, RigidTransform.identity())
        return self._bent(tissue.mesh.vertices, still, frame, below, barrier, tissue.creases)

    def solve_after(self, before: SimulatedFrame, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As `solve`, bent from another frame.

        Raises
        ------
        ConvergenceError
            Where a step fails, however small.
        """
        tissue, barrier = self.tissue, self.tissue.skin_barrier()
        if tissue.creases is None or barrier is None:
            return super().solve_after(before, frame, below)
        then, shapes = before
        x = np.asarray(shapes[self.name][f"{self.name}_mesh"].vertices)
        settled = self._bent(x, then.bones, frame, below, barrier, tissue.creases)
        return self.shapes_at(settled, frame, below)

    def shapes_at(self, settled: Settled, frame: Frame, below: Mapping[str, Shapes]) -> Shapes:
        """As of `TissueLayer`; the skin's figures tell, too, how deep (mm) and sharp (deg) it folds."""
        shapes, creases = super().shapes_at(settled, frame, below), self.tissue.creases
        if creases is None:
            return shapes
        skin, neutral = shapes["skin"], self.tissue.skin
        folds = fold_form(neutral, neutral.moved(skin.vertices), creases.folding)
        return shapes | {"skin": replace(skin, figures=skin.figures | folds)}

    def _bent(
        self,
        x: Array,
        origin: Mapping[str, RigidTransform],
        frame: Frame,
        below: Mapping[str, Shapes],
        barrier: Barrier,
        creases: Creases,
    ) -> Settled:
        """The equilibrium in a frame, bent without crossings from x (n, 3), where bones are at `origin`."""
        parents = creases.parents
        most = max((turn(origin, frame.bones, child, of) for child, of in parents.items()), default=0.0)
        first = 1.0 / max(1, int(np.ceil(most / STEP)))
        done, step, before = 0.0, first, origin
        while done < 1.0:
            share = min(1.0, done + step)
            bones = partway(origin, frame.bones, parents, share)
            scene = Scene(self.tissue, moved(below, bones), self.rigid(bones), self.tissue.elastic)
            start = self._carried(x, before, bones, barrier)
            try:
                x = scene.solve([barrier], start, start, BRIEF).x
            except ConvergenceError as error:
                step *= 0.5
                if step < SMALLEST * first:
                    raise error.within(f"{self.name} of {frame.name} at {share:.2f} of its bend") from error
                log.info("%s: %s; halving the step", self.name, error)
                continue
            done, before = share, bones
        return behind(Scene(self.tissue, below, self.rigid(frame.bones), self.tissue.elastic), barrier, x)

    def _carried(
        self,
        x: Array,
        before: Mapping[str, RigidTransform],
        bones: Mapping[str, RigidTransform],
        barrier: Barrier,
    ) -> Array:
        """Positions x (n, 3) moved on with the bones as far as the skin stays out of itself."""
        tissue = self.tissue
        step = tissue.carried(x, before, bones) - x
        free = barrier.max_step(x, step)
        carried: Array = x + free * step
        return carried


def partway(
    origin: Mapping[str, RigidTransform],
    bones: Mapping[str, RigidTransform],
    parents: Mapping[str, str],
    share: float,
) -> dict[str, RigidTransform]:
    """Bones at a share of their way from `origin`: each turns by a screw relative to its parent."""
    found = {
        name: origin[name] @ part_of(origin[name].inverse() @ bone, share)
        for name, bone in bones.items()
        if name not in parents
    }
    for child, parent in parents.items():
        first, last = (pose[parent].inverse() @ pose[child] for pose in (origin, bones))
        found[child] = found[parent] @ first @ part_of(first.inverse() @ last, share)
    return found


def part_of(transform: RigidTransform, share: float) -> RigidTransform:
    """A share of the screw that a transform is."""
    vector = transform.rotation_vector()
    along = np.linalg.solve(left_jacobian(vector), transform.translation)
    turned = Rotation.from_rotvec(share * vector).as_matrix()
    return RigidTransform(turned, left_jacobian(share * vector) @ (share * along))


def turn(
    origin: Mapping[str, RigidTransform], bones: Mapping[str, RigidTransform], child: str, parent: str
) -> float:
    """Angle in rad by which a bone turns relative to another, from `origin`."""
    first, last = (pose[parent].inverse() @ pose[child] for pose in (origin, bones))
    return first.angle_to(last)


def moved(below: Mapping[str, Shapes], bones: Mapping[str, RigidTransform]) -> dict[str, Shapes]:
    """The bones' shapes at other transforms."""
    return {
        layer: {name: replace(shape, vertices=bones[name](shape.rest)) for name, shape in shapes.items()}
        for layer, shapes in below.items()
        if layer == "bones"
    }


def load_skin(files: Sequence[Path], _: Mapping[str, Surface]) -> TissueLayer:
    """One soft tissue around the bones, with creases where its artifact has them.

    Parameters
    ----------
    files : sequence of path
        The artifact of its mesh.
    _ : mapping of str to Surface
        Not used.

    Returns
    -------
    TissueLayer
        The layer "skin".

    References
    ----------
    Zheng 2022 Table 4, model m2; Wang 2019.
    """
    [mesh] = files
    tissue = Tissue.load(mesh)
    layer = TissueLayer if tissue.creases is None else CreaseLayer
    return layer("skin", tissue)
