"""Figures of a segmentation without truth: bones that look unusual, or differ in size between poses."""

from __future__ import annotations

from collections.abc import Mapping

from handpipe.core import Metrics
from handpipe.imaging.segmentation import Appearance


def looks_figures(
    looks: Mapping[str, Mapping[str, Appearance]], left_out: Mapping[str, Mapping[str, str]], neutral: str
) -> Metrics:
    """Figures of segmented bones, and the number of omitted bones.

    `left_out_bones` counts bones whose seeds are missing or wrong. Of the other bones, `cut_off_bones` counts
    those that reach the volume's border, `enclosed_min` is the least share of a boundary with a dark shell,
    and `volume_change_max` is the largest relative difference of a marrow's volume from neutral.

    Parameters
    ----------
    looks : mapping of str to mapping of str to Appearance
        Appearance in the image by pose and bone.
    left_out : mapping of str to mapping of str to str
        Reason by pose and omitted bone.
    neutral : str
        Name of the neutral pose.

    Returns
    -------
    Metrics
        The four figures, all dimensionless.
    """
    kept = [
        (name, look)
        for pose, bones in looks.items()
        for name, look in bones.items()
        if name not in left_out[pose]
    ]
    first = looks[neutral]
    whole = [(n, k) for n, k in kept if n in first and not (k.cut_off or first[n].cut_off)]
    changes = [abs(look.volume / first[name].volume - 1) for name, look in whole]
    return {
        "left_out_bones": (sum(len(bones) for bones in left_out.values()), "1"),
        "cut_off_bones": (sum(look.cut_off for _, look in kept), "1"),
        "enclosed_min": (min((look.enclosed for _, look in kept), default=0.0), "1"),
        "volume_change_max": (max(changes, default=0.0), "1"),
    }
