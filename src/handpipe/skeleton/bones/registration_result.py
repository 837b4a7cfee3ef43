"""What a registration found, how sure it is of it, and how it is kept in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, RigidTransform, artifacts
from handpipe.mesh.surfaces import Surface

ALONG = 0.9  # cosine of the angle up to which an axis is a bone's long one


@dataclass(frozen=True)
class Registration:
    """transform from neutral to the pose; rms in mm of the robust distances that it leaves.

    covariance (6, 6) of (omega, t) in rad and mm: the true transform is the found one followed by a
    rotation by omega about its image of the neutral vertices' mean and a translation by t. It knows the
    noise of the target, also where neighbours or a patch of some millimetres share it, not what both
    surfaces have wrong alike.
    covered, explained: shares of the neutral surface that lie on the target and of the target that lie on
    the neutral surface; doubt: why the result is not to be trusted, empty if it is.
    """

    transform: RigidTransform
    rms: float
    covariance: Array
    covered: float = 1.0
    explained: float = 1.0
    doubt: str = ""

    @property
    def rotation_deviation(self) -> float:
        """Root mean square angle in deg that the true rotation is expected to be off."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[:3, :3]))))

    @property
    def translation_deviation(self) -> float:
        """Root mean square distance in mm that the bone's middle is expected to be off."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))

    def deviation_at(self, arm: Array) -> float:
        """Root mean square distance in mm that a point is off which lies `arm` (3,) from the bone's middle.

        arm is that of the pose, not of neutral.
        """
        across = -np.cross(np.eye(3), arm)  # across @ omega is the cross product of omega and arm
        moved = np.hstack([across, np.eye(3)])
        return float(np.sqrt(np.trace(moved @ self.covariance @ moved.T)))


def rotation_uncertainty(registration: Registration) -> Array:
    """Standard deviations (3,) in deg of the rotation along its principal directions, largest first."""
    values = np.linalg.eigvalsh(registration.covariance[:3, :3])[::-1]
    return np.degrees(np.sqrt(np.maximum(values, 0)))


def loosest_turn(registration: Registration, neutral: Surface) -> str:
    """The turn that is known least, in words, with its standard deviation; neutral: the bone's surface."""
    _, axes = np.linalg.eigh(np.cov(neutral.vertices.T))
    _, turns = np.linalg.eigh(registration.covariance[:3, :3])
    along = abs(float(turns[:, 2] @ registration.transform.rotation @ axes[:, 2]))
    deviation = float(rotation_uncertainty(registration)[0])
    about = " about its long axis" if along > ALONG else ""
    return f"its turn{about} (standard deviation {deviation:.1f} deg)"


def write_registrations(
    path: str | Path, found: Mapping[str, Registration], inputs: Sequence[str | Path] = ()
) -> None:
    """Write a pose's registrations by bone as an artifact (kind "registration")."""
    data = {
        bone: {
            "rotation": r.transform.rotation,
            "translation": r.transform.translation,
            "rms": r.rms,
            "covariance": r.covariance,
            "rotation_deviation": r.rotation_deviation,
            "translation_deviation": r.translation_deviation,
            "covered": r.covered,
            "explained": r.explained,
            "doubt": r.doubt,
        }
        for bone, r in found.items()
    }
    fields = {
        "translation": "mm",
        "rms": "mm",
        "rotation_deviation": "deg",
        "translation_deviation": "mm",
        "covered": "1",
        "explained": "1",
    }
    units = {f"{bone}/{field}": unit for bone in found for field, unit in fields.items()}
    artifacts.write(path, data, kind="registration", units=units, inputs=inputs)


def read_registrations(path: str | Path) -> dict[str, Registration]:
    """A pose's registrations by bone; those in doubt are among them."""
    return {
        bone: Registration(
            RigidTransform(d["rotation"], d["translation"]),
            float(d["rms"]),
            d["covariance"],
            float(d["covered"]),
            float(d["explained"]),
            str(d["doubt"]),
        )
        for bone, d in artifacts.read(path, "registration").items()
    }
