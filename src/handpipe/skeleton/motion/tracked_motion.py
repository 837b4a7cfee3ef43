"""Angles of frames from tracked points: a fit of every row, a filter over time, and the frames of the scene.

1. Every row is fitted by inverse kinematics within limits, as landmarks are, from the row before.
2. An angle that leaves the median of the seven rows around it by more than three deviations (1.4826 times
   the median absolute deviation) and 5 degrees is an outlier of tracking and becomes that median
   (Hampel 1974).
3. Gaps up to a stated length are bridged by monotone splines; longer ones cut the recording: no frames.
4. A Gaussian of a stated deviation smooths each piece: its weights are positive, so that limits hold, and
   it is symmetric, so that it delays nothing.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from handpipe.core import Array, BoolArray
from handpipe.core.configuration import Recording
from handpipe.skeleton.drivers.landmark_motion import (
    KNUCKLES,
    REST_WEIGHT,
    TOLERANCE,
    LandmarkMap,
    fit_points,
    wrist,
)
from handpipe.skeleton.drivers.landmarks import Hand
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.motion.interpolation import spline
from handpipe.skeleton.motion.motion import Motion
from handpipe.skeleton.motion.tracks import NAMES, Track, frame_times, read_track
from handpipe.skeleton.posing.inverse_kinematics import ReachOptions
from handpipe.skeleton.rig.rig import Rig

LOG = logging.getLogger(__name__)
AROUND = 7  # rows of the running median
FAR, LEAST = 3 * 1.4826, np.radians(5.0)  # of an outlier: deviations by the median one, and rad


def read_tracked_motion(path: str | Path, rig: Rig, hand: Hand, recording: Recording) -> Motion:
    """Angles of a scene's frames from a recording of tracked points, within limits.

    Parameters
    ----------
    path : str or Path
        CSV file of the recording.
    rig : Rig
        Rig that the points move.
    hand : str
        "right" or "left": the hand that the rig is of. Points of the other hand are mirrored.
    recording : Recording
        Which hand and which part of it, and the filter.

    Returns
    -------
    Motion
        Frames, with `tracking_residual` in mm, the root mean square distance of the fitted bones' points from
        the tracked ones, and `bridged`, 1 where the frame lies in a gap.

    Raises
    ------
    InputError
        If the file is wrong, or the palm does not fit the rig's.
    """
    track = read_track(path, recording.side or hand)
    frames = frame_times(path, track, recording)
    at = np.array([*frames.values()])
    margin = 4 * recording.smooth + recording.bridge
    near = (track.times >= at[0] - margin) & (track.times <= at[-1] + margin)
    values, residuals = _fitted(path, rig, track, near, mirrored=track.hand != hand)
    times = track.times[near]
    kept, outliers = without_outliers(times, values)
    smooth = smoothed(times, kept, at, recording)
    lower, upper = np.array([rig.limits[n] for n in rig.angle_names]).T
    smooth = np.clip(smooth, lower, upper)  # rounding alone
    errors, turns = (np.interp(at, times, column) for column in residuals.T)
    gap = _in_gaps(at, track.gaps(0.0))
    said = _said(track, recording, (float(at[0]), float(at[-1])), outliers)
    spread, turn = np.sqrt((errors**2).mean()), np.sqrt((turns**2).mean())
    said.append(f"residual of the fit, root mean square: points {spread:.1f} mm, directions {turn:.1f} deg")
    for sentence in said:
        LOG.info("%s: %s", path, sentence)
    angles: dict[str, Angles] = {
        frame: dict(zip(rig.angle_names, map(float, row), strict=True))
        for frame, row in zip(frames, smooth, strict=True)
    }
    figures = {
        frame: {"tracking_residual": float(error), "bridged": float(bridged)}
        for frame, error, bridged in zip(frames, errors, gap, strict=True)
    }
    return Motion(angles, figures, said)


def _fitted(
    path: str | Path, rig: Rig, track: Track, chosen: BoolArray, mirrored: bool
) -> tuple[Array, Array]:
    """Angles (n, k) in rad of the chosen rows, and residuals (n, 2): points in mm, directions in deg."""
    where = LandmarkMap.of_rig(rig)
    where = where if track.directions is None else where.with_wrist(rig)
    mirror = np.array([-1.0, 1, 1]) if mirrored else np.ones(3)
    angles: Angles = {}
    values, residuals = [], []
    for i in np.flatnonzero(chosen):
        seen = dict(zip(NAMES, track.points[i] * mirror, strict=True))
        if track.directions is not None:
            seen["WRIST"] = wrist(np.array([seen[n] for n in KNUCKLES]), track.directions[i] * mirror)
        options = ReachOptions(rest_weight=REST_WEIGHT, tolerance=TOLERANCE, restarts=not angles)
        found = fit_points(seen, rig, where, angles, options, f"{path}: {track.times[i]:.3f} s")
        angles = found.angles
        values.append([angles[n] for n in rig.angle_names])
        residuals.append((found.distance, np.degrees(found.turn)))
    return np.array(values), np.array(residuals)


def without_outliers(times: Array, values: Array) -> tuple[Array, int]:
    """Values (n, k) with outliers in time replaced by the running median, and their number."""
    middle = median_filter(values, size=(AROUND, 1), mode="nearest")
    off = np.abs(values - middle)
    spread = median_filter(off, size=(AROUND, 1), mode="nearest")
    odd = off > np.maximum(FAR * spread, LEAST)
    return np.where(odd, middle, values), int(odd.any(axis=1).sum())


def smoothed(times: Array, values: Array, at: Array, recording: Recording) -> Array:
    """Values (m, k) at times (m,) in s, filtered, from rows (n, k) at times (n,), piece by piece."""
    found = np.zeros((len(at), values.shape[1]))
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    cuts = np.flatnonzero(np.diff(times) > max(recording.bridge, 1.5 * step)) + 1
    for piece in np.split(np.arange(len(times)), cuts):
        t = times[piece]
        here = (at >= t[0] - step) & (at <= t[-1] + step)
        if not here.any():
            continue
        dense = np.linspace(t[0], t[-1], max(int(np.ceil((t[-1] - t[0]) / step)) + 1, 1))
        rows = spline(t, values[piece], dense)
        if recording.smooth > 0 and len(dense) > 1:
            rows = gaussian_filter1d(rows, recording.smooth / (dense[1] - dense[0]), axis=0, mode="nearest")
        found[here] = np.column_stack([np.interp(at[here], dense, column) for column in rows.T])
    return found


def _in_gaps(at: Array, gaps: list[tuple[float, float]]) -> BoolArray:
    inside = np.zeros(len(at), bool)
    for first, last in gaps:
        inside |= (at > first) & (at < last)
    return inside


def _said(track: Track, recording: Recording, span: tuple[float, float], outliers: int) -> list[str]:
    """Sentences on gaps, rows and the filter."""
    gaps = [(a, b) for a, b in track.gaps(0.0) if b > span[0] and a < span[1]]
    said = [f"Gaussian filter of {recording.smooth:g} s on joint angles"]
    said += [f"{track.unsure} rows of little confidence are left out"] if track.unsure else []
    said += [f"{outliers} rows with an outlier are replaced by the running median"] if outliers else []
    for first, last in gaps:
        what = "bridged" if last - first <= recording.bridge else "longer than is bridged: no frames"
        said.append(f"gap from {first:.2f} to {last:.2f} s: {what}")
    return said
