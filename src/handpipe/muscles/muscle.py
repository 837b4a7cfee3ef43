"""A muscle that can be simulated: its neutral body, and its plastic strains over poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handpipe import artifacts
from handpipe.fem import plasticity
from handpipe.mesh.rigid import RigidTransform
from handpipe.muscles.body import Body
from handpipe.skeleton.pose_space import Interpolation, PoseSpace

Array = NDArray[np.float64]

KIND = "muscle"


@dataclass(frozen=True)
class Muscle:
    """name; body in neutral; space: its pose space, whose examples have the logarithms (N, m, 6) of plastic strains.

    Neutral is one of the examples, with logarithm zero. Logarithms are interpolated, so that every strain between the
    examples is positive definite whatever the weights are.
    """

    name: str
    body: Body
    space: PoseSpace
    logs: Array

    @staticmethod
    def of(
        name: str,
        body: Body,
        parents: Mapping[str, str],
        neutral: str,
        transforms: Mapping[str, Mapping[str, RigidTransform]],
        strains: Sequence[Array],
        interpolation: Interpolation = "inverse-square",
    ) -> Muscle:
        """From plastic strains (m, 6) in example poses, whose transforms are pose -> bone -> from neutral."""
        still = {bone: RigidTransform.identity() for bone in body.attachments}
        space = PoseSpace.build(list(body.attachments), parents, {neutral: still, **transforms}, interpolation)
        logs = np.stack([np.zeros((len(body.mesh.tets), 6)), *(plasticity.log(s) for s in strains)])
        return Muscle(name, body, space, logs)

    def strains(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Plastic strains (m, 6) in a pose (000 Eq. 2, in logarithms)."""
        return plasticity.exp(self.space.interpolate(self.logs, bones))

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the artifact."""
        data = {"name": self.name, "body": self.body.to_group(), "space": self.space.to_group(), "logs": self.logs}
        units = {"body/vertices": "mm", "body/mesh/vertices": "mm", "space/examples": "rad", "logs": "1"}
        artifacts.write(path, data, kind=KIND, units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Muscle:
        """Read the artifact; raises `InputError` where it is not one."""
        data = artifacts.read(path, KIND)
        body, space = Body.from_group(data["body"]), PoseSpace.from_group(data["space"])
        return Muscle(str(data["name"]), body, space, data["logs"])
