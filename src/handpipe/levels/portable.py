"""A learned hand as one NumPy archive, which a page of plain NumPy plays (docs/levels.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import atomic
from handpipe.levels.learned_hand import LearnedHand


def write_portable(path: str | Path, hand: LearnedHand) -> None:
    """Write template, weights, joints and correctives as arrays by name.

    Parameters
    ----------
    path : path
        Archive to be written, with the ending .npz.
    hand : LearnedHand
        Hand that L1 plays. Lengths are in mm, angles in rad.
    """
    bodies = hand.bodies
    arrays: dict[str, Any] = {
        "angle_names": np.array(hand.angle_names),
        "bones": np.array(hand.bones),
        "body_names": np.array(["/".join(name) for name in bodies]),
        "body_ends": np.cumsum([len(body.rest) for body in bodies.values()]),
        "template": hand.rest,
        "joints": hand.joints.astype(np.int32),
        "weights": hand.weights.astype(np.float32),
        "lower": hand.correctives.lower,
        "upper": hand.correctives.upper,
        **{f"cells_{i}": body.cells for i, body in enumerate(bodies.values())},
        **{f"joint_{name}": value for name, value in hand.skeleton.joints._asdict().items()},
    }
    for part in range(len(hand.correctives.errors)):
        arrays |= {f"part_{part}_{name}": value for name, value in _part(hand, part).items()}
    with atomic(path) as temporary:
        np.savez_compressed(temporary, **arrays)


def _part(hand: LearnedHand, part: int) -> dict[str, Any]:
    """A part's vertices (m,), shapes (K, m, 3), angles (d,), poses (F, d), gains (F, K), kernel (2,)."""
    drivers, shapes = hand.correctives.drivers, hand.correctives.shapes
    rows = np.flatnonzero(shapes.parts == part)
    count = int(drivers.ends[part + 1] - drivers.ends[part])
    places = shapes.starts[rows][:, None, None] + count * np.arange(3)[:, None] + np.arange(count)
    angles = drivers.of_part[drivers.at[part] : drivers.at[part + 1]]
    known = drivers.known[drivers.known_at[part] : drivers.known_at[part + 1]]
    gains = drivers.gains[drivers.gains_at[part] : drivers.gains_at[part + 1]]
    return {
        "vertices": np.searchsorted(shapes.rows, rows, side="right") - 1,
        "shapes": shapes.basis[places].transpose(2, 0, 1),
        "angles": angles,
        "poses": known.reshape(-1, len(angles)),
        "gains": gains.reshape(-1, count) if count else np.zeros((0, 0)),
        "kernel": drivers.kinds[part],
    }
