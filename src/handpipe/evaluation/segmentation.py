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
    and `volume_change_max` is the largest relative difference of a marrow's volume from neutral. `thin_bones`
    counts bones whose marrow is less than four voxels across in neutral; `marrow_width_{bone}` is the width
    of each of them in voxels.

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
        The figures, all dimensionless.
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
    thin = {name: look.width for name, look in first.items() if look.thin}
    return {
        "left_out_bones": (sum(len(bones) for bones in left_out.values()), "1"),
        "cut_off_bones": (sum(look.cut_off for _, look in kept), "1"),
        "enclosed_min": (min((look.enclosed for _, look in kept), default=0.0), "1"),
        "volume_change_max": (max(changes, default=0.0), "1"),
        "thin_bones": (len(thin), "1"),
        **{f"marrow_width_{name}": (width, "1") for name, width in thin.items()},
    }


def bone_warnings(figures: Metrics) -> list[str]:
    """Sentences on bones that are left out or whose surface is uncertain.

    Parameters
    ----------
    figures : Metrics
        Figures of the segmentation, as `looks_figures` gives them.

    Returns
    -------
    list of str
        A sentence for each kind of doubt; empty if there is none.
    """
    gone = int(figures.get("left_out_bones", (0, "1"))[0])
    found = [f"Bones left out in some pose: {gone}. The logs of segmentation name them."] if gone else []
    prefix = "marrow_width_"
    thin = [
        f"{name.removeprefix(prefix)} ({width:.1f})"
        for name, (width, _) in figures.items()
        if name.startswith(prefix)
    ]
    if thin:
        found.append(f"Bones of few voxels across, whose surfaces are uncertain: {', '.join(thin)}.")
    return found
