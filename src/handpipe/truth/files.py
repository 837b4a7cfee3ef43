"""The truth of a pose on disk, as the datasets have it: surfaces of every body, displacements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handpipe import artifacts
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.truth.body import Body, Pose
from handpipe.truth.surfaces import bone_faces

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PosedBody:
    """A coupled body in one pose.

    Surfaces share their triangles with those at rest. `rest` (n, 3) and `displacement` (n, 3) are of the
    nodes, `tets` (m, 4) between them with `labels` (m,) that number the `regions`.
    """

    transforms: dict[str, RigidTransform]
    bones: dict[str, Surface]
    muscles: dict[str, Surface]
    tendons: dict[str, Array]
    tendon_radii: dict[str, float]
    skin: Surface
    rest: Array
    displacement: Array
    tets: IntArray
    labels: IntArray
    regions: tuple[str, ...]

    @staticmethod
    def of(body: Body, pose: Pose, x: Array) -> PosedBody:
        """A body whose nodes are at x (n, 3); bones face outwards, as the skin does."""
        bones = {
            name: Surface(x, bone_faces(body.cells, nodes)).flipped().compact()
            for name, nodes in body.on_bones.items()
        }
        return PosedBody(
            dict(pose.bones),
            bones,
            {name: body.surface(name, x) for name in body.muscles},
            {name: body.strand_points(name) @ x for name in body.strands},
            {name: strand.radius for name, strand in body.anatomy.strands.items()},
            Surface(x, body.skin_faces).compact(),
            body.rest,
            x - body.rest,
            body.cells.tets,
            body.cell_labels,
            body.anatomy.regions,
        )

    def moved(self, root: RigidTransform) -> PosedBody:
        """The same pose in another frame: all of it, the root bone too, under a rigid motion."""

        def surfaces(given: Mapping[str, Surface]) -> dict[str, Surface]:
            return {name: s.moved(root(s.vertices)) for name, s in given.items()}

        return PosedBody(
            {name: root @ transform for name, transform in self.transforms.items()},
            surfaces(self.bones),
            surfaces(self.muscles),
            {name: root(line) for name, line in self.tendons.items()},
            self.tendon_radii,
            self.skin.moved(root(self.skin.vertices)),
            self.rest,
            root(self.rest + self.displacement) - self.rest,
            self.tets,
            self.labels,
            self.regions,
        )


def write(
    path: str | Path,
    posed: PosedBody,
    *,
    angles: Mapping[str, float],
    joints: Mapping[str, Mapping[str, Array]],
    inputs: Sequence[str | Path] = (),
) -> None:
    """Write a pose (kind "truth"); angles in rad, joints as name -> axes (dof, 3) and centre (3,).

    Beside what the phantoms' truth has there is `field`, in mm.
    """
    data: dict[str, Any] = {
        "bones": {
            name: {
                "rotation": posed.transforms[name].rotation,
                "translation": posed.transforms[name].translation,
                **_surface(bone),
            }
            for name, bone in posed.bones.items()
        },
        "muscles": {name: _surface(muscle) for name, muscle in posed.muscles.items()},
        "tendons": {
            name: {"centreline": line, "radius": posed.tendon_radii[name]}
            for name, line in posed.tendons.items()
        },
        "skin": _surface(posed.skin),
        "field": {
            "rest": posed.rest,
            "displacement": posed.displacement,
            "tets": posed.tets,
            "labels": posed.labels,
            "regions": list(posed.regions),
        },
        "angles": dict(angles),
        "joints": {name: dict(joint) for name, joint in joints.items()},
    }
    units = {"bones": "mm", "muscles": "mm", "tendons": "mm", "skin": "mm", "field": "mm", "angles": "rad"}
    artifacts.write(path, data, kind="truth", units=units, inputs=inputs)


def _surface(surface: Surface) -> dict[str, NDArray]:
    return {"vertices": surface.vertices, "triangles": surface.triangles}
