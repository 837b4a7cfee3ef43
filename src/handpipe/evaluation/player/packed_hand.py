"""A learned hand as one compressed text: what its script reads, shapes rounded to integers."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array
from handpipe.levels import LearnedHand

ROUNDING = 0.005  # mm that the rounded shapes of a part may move a vertex by along an axis, if independent
ALIGNED = 8  # bytes, at whose multiples arrays begin
FLOATS = {"f4": "Float32Array", "f8": "Float64Array"}
KINDS = {**FLOATS, "i2": "Int16Array", "i4": "Int32Array", "u1": "Uint8Array"}  # names in the script


def packed_hand(hand: LearnedHand, further: Mapping[str, NDArray]) -> tuple[dict[str, Any], str, float]:
    """Pack what evaluates a hand.

    Parameters
    ----------
    hand : LearnedHand
        Hand that is drawn.
    further : mapping of str to array
        Arrays to be added, by name.

    Returns
    -------
    index : dict
        By array the script's type, the first byte and the number of values.
    packed : str
        All bytes, compressed by gzip, in base64.
    rounding : float
        Distance in mm between neutral points with rounded and with exact shapes in learned poses, at most.
    """
    shapes, rounding = _rounded_shapes(hand)
    drivers, alarm, correctives = hand.correctives.drivers, hand.alarm, hand.correctives
    arrays: dict[str, NDArray] = {
        "rest": hand.rest,
        "joints": hand.joints.astype("u1"),
        "weights": hand.weights.astype("f4"),
        "dual": hand.dual.astype("u1"),
        "lower": correctives.lower,
        "upper": correctives.upper,
        **{f"skeleton_{name}": value for name, value in hand.skeleton.joints._asdict().items()},
        **{f"drivers_{name}": value for name, value in drivers._asdict().items()},
        **shapes,
        **{f"alarm_{name}": getattr(alarm, name) for name in ("typical", "lower", "upper")},
        "alarm_scales": np.array([alarm.farthest, alarm.gap]),
        **further,
    }
    index, blob = {}, bytearray()
    for name, array in arrays.items():
        narrow = np.ascontiguousarray(array, "i4") if array.dtype == np.int64 else np.ascontiguousarray(array)
        blob.extend(bytes(-len(blob) % ALIGNED))
        index[name] = [KINDS[narrow.dtype.str[1:]], len(blob), int(narrow.size)]
        blob.extend(narrow.tobytes())
    return index, base64.b64encode(gzip.compress(bytes(blob), mtime=0)).decode("ascii"), rounding


def _rounded_shapes(hand: LearnedHand) -> tuple[dict[str, NDArray], float]:
    """Rows, parts and integers of the shapes with their steps (K,), and what rounding moves at most in mm.

    A row has x, y, z of each shape of its part, one shape after the other.
    """
    rows, parts, starts, basis = hand.correctives.shapes
    ends = hand.correctives.drivers.ends
    sizes = 3 * np.diff(ends)[parts]
    first = np.cumsum(sizes) - sizes
    integers, steps = np.zeros(int(sizes.sum()), np.int16), np.ones(ends[-1])
    moved = np.zeros(len(parts))
    for part, (start, end) in enumerate(pairwise(ends)):
        own, places = np.flatnonzero(parts == part), np.arange(3 * (end - start))
        values = basis[starts[own][:, None] + places].reshape(len(own), 3, end - start).astype(float)
        amounts = hand.correctives.learned_amounts(part)
        rounded, steps[start:end] = _rounded(values, amounts)
        integers[first[own][:, None] + places] = rounded.transpose(0, 2, 1).reshape(len(own), len(places))
        apart = (values - rounded * steps[start:end]) @ amounts.T
        moved[own] = np.linalg.norm(apart, axis=1).max(axis=1, initial=0.0)
    by_vertex = np.diff(np.append(0.0, np.cumsum(moved))[rows])
    shapes: dict[str, NDArray] = {"rows": rows, "parts": parts, "basis": integers, "steps": steps}
    return shapes, float(by_vertex.max(initial=0.0))


def _rounded(values: Array, amounts: Array) -> tuple[Array, Array]:
    """Integers of shapes (m, 3, K), and the steps (K,) between them.

    The steps are finer where learned poses, with amounts (F, K), need more of a shape, so that most integers
    are small and compress well.
    """
    largest = np.maximum(np.abs(amounts).max(axis=0, initial=0.0), np.finfo(np.float32).tiny)
    most = np.maximum(np.abs(values).max(axis=(0, 1), initial=0.0), np.finfo(np.float32).tiny)
    wanted = 2 * ROUNDING / (np.sqrt(max(len(largest), 1)) * largest)
    steps = np.clip(wanted, most / np.iinfo(np.int16).max, most)
    return np.rint(values / steps), steps
