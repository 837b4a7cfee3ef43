"""Which scans of a folder lie in a frame of their own, told by the skin in their volumes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from handpipe.core import HandpipeError
from handpipe.imaging.volumes import read_volume
from handpipe.mesh.files import read_scan
from handpipe.skeleton.scan_alignment import ScanPlace, place_of_scan

ALIKE = "as the other scans are in a frame of their own"


def own_frames(folder: Path, poses: Mapping[str, Mapping[str, Path]]) -> dict[str, str]:
    """Poses whose scans have to be aligned to their volumes, with the reason.

    One scanner takes the scans of all poses: where one scan is elsewhere, all are in a frame of their own.

    Parameters
    ----------
    folder : path
        That the files are relative to.
    poses : mapping of str to mapping of str to path
        Files of each pose by field.

    Returns
    -------
    dict of str to str
        Reason by pose; empty where every scan fits its volume, or none can be compared with one. What cannot
        be read is left to the check.
    """
    scanned = {pose: files for pose, files in poses.items() if "scan" in files}
    places = {
        pose: _place(folder / files["scan"], folder / files["volume"]) for pose, files in scanned.items()
    }
    reasons = {pose: _reason(place) for pose, place in places.items() if place and place.own_frame}
    return {pose: reasons.get(pose, ALIKE) for pose in scanned} if reasons else {}


def _place(scan: Path, volume: Path) -> ScanPlace | None:
    try:
        return place_of_scan(read_scan(scan), read_volume(volume))
    except HandpipeError:
        return None


def _reason(place: ScanPlace) -> str:
    return (
        f"the scan fits its volume once turned by {place.turn:.0f} deg and moved by {place.shift:.0f} mm "
        f"(Dice coefficient {place.moved:.2f}; {place.agreement:.2f} as it is)"
    )
