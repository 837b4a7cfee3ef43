"""The result of a registration: transform, covariance and doubt, and its file."""

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
    """The rigid transform of one bone from neutral to a pose, and how well it is known.

    Parameters
    ----------
    transform : RigidTransform
        From neutral to the pose's frame, mm.
    rms : float
        Root mean square in mm of the robust distances that it leaves.
    covariance : array (6, 6)
        Covariance of (omega, t) in rad and mm: the true transform is the found one followed by a rotation by
        omega about its image of the neutral vertices' mean and a translation by t. It includes the noise of
        the target, also where neighbours or a patch of some millimetres share it, but not errors that both
        surfaces have in common.
    covered : float
        Share of the neutral surface that lies on the target.
    explained : float
        Share of the target that lies on the neutral surface.
    doubt : str
        Why the result is not to be trusted, empty if it is.
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
        """Root mean square distance in mm by which a point of the bone is expected to be off.

        Parameters
        ----------
        arm : array (3,)
            From the bone's middle to the point in mm, in the pose and not in neutral.

        Returns
        -------
        float
            Distance in mm.
        """
        across = -np.cross(np.eye(3), arm)  # across @ omega is the cross product of omega and arm
        moved = np.hstack([across, np.eye(3)])
        return float(np.sqrt(np.trace(moved @ self.covariance @ moved.T)))


def rotation_uncertainty(registration: Registration) -> Array:
    """Standard deviations (3,) in deg of the rotation along its principal directions, largest first."""
    values = np.linalg.eigvalsh(registration.covariance[:3, :3])[::-1]
    return np.degrees(np.sqrt(np.maximum(values, 0)))


def loosest_turn(registration: Registration, neutral: Surface) -> str:
    """The turn that is known least, in words, with its standard deviation.

    Parameters
    ----------
    registration : Registration
        Registration of a bone.
    neutral : Surface
        Neutral surface of the bone.

    Returns
    -------
    str
        Whether the turn is about the bone's long axis, and its standard deviation in deg.
    """
    _, axes = np.linalg.eigh(np.cov(neutral.vertices.T))
    _, turns = np.linalg.eigh(registration.covariance[:3, :3])
    along = abs(float(turns[:, 2] @ registration.transform.rotation @ axes[:, 2]))
    deviation = float(rotation_uncertainty(registration)[0])
    about = " about its long axis" if along > ALONG else ""
    return f"its turn{about} (standard deviation {deviation:.1f} deg)"


def write_registrations(
    path: str | Path, found: Mapping[str, Registration], inputs: Sequence[str | Path] = ()
) -> None:
    """Write a pose's registrations as an artifact.

    Parameters
    ----------
    path : str or Path
        File to write.
    found : mapping of str to Registration
        Registrations by bone.
    inputs : sequence of str or Path, optional
        Files that the registrations were computed from; the artifact records their hashes.
    """
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
    """A pose's registrations, with their figures.

    Parameters
    ----------
    path : str or Path
        Artifact that `write_registrations` wrote.

    Returns
    -------
    dict of str to Registration
        Registrations by bone, including those in doubt.

    Raises
    ------
    InputError
        As `artifacts.read` does.
    """
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
