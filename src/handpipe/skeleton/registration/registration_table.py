"""A table of all registered bones and the figures that it comes to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from handpipe.core import Metrics, metrics
from handpipe.skeleton.bones.registration_result import Registration

Row = dict[str, str | float]
Errors = Mapping[str, tuple[float, float]]
UNITS = {"rotation": "deg", "translation": "mm"}
UNSURE = 2.0  # deg of deviation from which a turn is named; the rig gives such a bone little weight


def registration_rows(pose: str, found: Mapping[str, Registration], errors: Errors) -> list[Row]:
    """A table of a pose's registered bones, one row per bone.

    Parameters
    ----------
    pose : str
        Name of the pose.
    found : mapping of str to Registration
        Registrations by bone.
    errors : mapping of str to (float, float)
        True errors by bone, of the rotation in deg and of the centroid in mm; empty where there is no truth.

    Returns
    -------
    list of dict
        Rows with `pose`, `bone`, the registration's figures (deg, mm, shares) and, if known, its true errors.
    """
    return [
        {
            "pose": pose,
            "bone": bone,
            "rotation_deviation": r.rotation_deviation,
            "translation_deviation": r.translation_deviation,
            "rms": r.rms,
            "covered": r.covered,
            "explained": r.explained,
            "doubt": r.doubt,
            **dict(zip(("rotation_error", "translation_error"), errors.get(bone, ()), strict=False)),
        }
        for bone, r in found.items()
    ]


def registration_figures(rows: Sequence[Row], missing: Sequence[tuple[str, str]]) -> Metrics:
    """Figures of the registrations of all poses.

    Parameters
    ----------
    rows : sequence of dict
        Rows of all poses, as `registration_rows` gives them.
    missing : sequence of (str, str)
        Pose and bone of each missing registration.

    Returns
    -------
    Metrics
        Numbers of doubtful and missing bones and of turns that are known poorly, with their names; each
        bone's deviations in deg and mm; largest deviations and errors of the bones that are not in doubt; and
        how well the deviations predict the errors: the root mean square of their ratio, ideally one, and the
        share of errors within two deviations.
    """
    trusted = [row for row in rows if not row["doubt"]]
    doubtful = [(str(row["pose"]), str(row["bone"])) for row in rows if row["doubt"]]
    figures: Metrics = {
        "doubtful_bones": (float(len(doubtful)), "1"),
        "missing_bones": (float(len(missing)), "1"),
    }
    figures |= {f"doubtful_{pose}_{bone}": (1.0, "1") for pose, bone in doubtful}
    figures |= {f"missing_{pose}_{bone}": (1.0, "1") for pose, bone in missing}
    loose = [row for row in trusted if float(row["rotation_deviation"]) > UNSURE]
    figures["unsure_turns"] = (float(len(loose)), "1")
    figures |= {
        f"unsure_turn_{row['pose']}_{row['bone']}": (float(row["rotation_deviation"]), "deg") for row in loose
    }
    for kind, unit in UNITS.items():
        for row in rows:
            name = f"{kind}_deviation_{row['pose']}_{row['bone']}"
            figures[name] = (float(row[f"{kind}_deviation"]), unit)
        stated = np.array([float(row[f"{kind}_deviation"]) for row in trusted])
        if len(trusted):
            figures[f"{kind}_deviation_max"] = (float(stated.max()), unit)
        if trusted and all(f"{kind}_error" in row for row in trusted):
            errors = np.array([float(row[f"{kind}_error"]) for row in trusted])
            figures |= metrics.summary(f"{kind}_error", errors, unit)
            ratio = errors / np.maximum(stated, 1e-12)
            figures[f"{kind}_error_by_deviation"] = (float(np.sqrt((ratio**2).mean())), "1")
            figures[f"{kind}_error_within_two_deviations"] = (float((ratio < 2).mean()), "1")
    return figures
