"""What is stated of the points of one body: what the examples leave open, and what the fit to them leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, RigidTransform
from handpipe.skeleton.posing import PoseSpace, left_out_weights, prediction_variance

REACH = 3.0  # mm: a point's mean squares are those of the points that are no farther
LEAST = 1e-6  # of the largest expected square: where examples coincide nothing is expected to be missed
POOLED = 0.2  # share of the whole body in a point's mean squares: few examples tell a single place's badly


@dataclass(frozen=True)
class BodyDeviation:
    """What is stated of the n points of a body, without the bones' part.

    Parameters
    ----------
    kind : str
        Kind of organ, of which `CALIBRATIONS` has a record.
    spaces : mapping of str to PoseSpace
        Pose spaces in which the body's corrections are interpolated.
    shares : array (n, number of spaces)
        Share of each space at each point.
    scale : array (n,)
        mm^2 by unit of `prediction_variance`: mean squares by which examples are missed when they are left
        out.
    fits : mapping of str to array (n,)
        mm^2 by example pose: mean squares of what remains between the simulated organ and what was seen.
    carried : array (n, number of bones)
        Share of each bone, in the order of the hand's, in the motion of each point.
    hidden : array (n,)
        mm^2, mean squares of what no image shows, in every pose.
    """

    kind: str
    spaces: Mapping[str, PoseSpace]
    shares: Array
    scale: Array
    fits: Mapping[str, Array]
    carried: Array
    hidden: Array

    def open_variance(self, bones: Mapping[str, RigidTransform]) -> Array:
        """Mean squares (n,) in mm^2 of what the examples leave open in a pose; zero at the examples."""
        found = [prediction_variance(space, space.vector(bones)) for space in self.spaces.values()]
        return self.scale * (self.shares @ np.array(found)) if found else np.zeros(len(self.scale))

    def fit_variance(self, pose: str | None = None) -> Array:
        """Mean squares (n,) in mm^2 of what the fit leaves: in an example pose its own, else their mean."""
        if pose is not None and pose in self.fits:
            return self.fits[pose]
        return np.mean([*self.fits.values()], axis=0) if self.fits else np.zeros(len(self.scale))

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {
            "kind": self.kind,
            "names": list(self.spaces),
            "spaces": {str(i): space.to_group() for i, space in enumerate(self.spaces.values())},
            "shares": self.shares,
            "scale": self.scale,
            "fits": dict(self.fits),
            "carried": self.carried,
            "hidden": self.hidden,
        }

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> BodyDeviation:
        """What `to_group` gave, as an artifact returned it."""
        spaces = {
            str(name): PoseSpace.from_group(group["spaces"][str(i)]) for i, name in enumerate(group["names"])
        }
        fits = group.get("fits", {})
        arrays = group["shares"], group["scale"], fits, group["carried"], group["hidden"]
        return BodyDeviation(str(group["kind"]), spaces, *arrays)


def left_out_scale(spaces: Sequence[PoseSpace], shares: Array, corrections: Array, near: Array) -> Array:
    """Mean squares by which examples are missed when they are left out, by unit of their variance.

    Parameters
    ----------
    spaces : sequence of PoseSpace
        Pose spaces of the same N examples.
    shares : array (n, number of spaces)
        Share of each space at each point.
    corrections : array (N, n, c)
        What is interpolated, in mm: c components at each point of each example.
    near : array (n, 3)
        Places of the points, mm, to take means over neighbours.

    Returns
    -------
    array (n,)
        mm^2 by unit of `prediction_variance`; zero where fewer than two examples are known.
    """
    missed, expected = np.zeros(len(near)), np.zeros(len(near))
    for rows in zip(*map(left_out_weights, spaces), strict=True):
        number = rows[0][0]
        weights = shares @ np.array([row[1] for row in rows])
        predicted = np.einsum("nk,knc->nc", weights, corrections)
        missed += ((corrections[number] - predicted) ** 2).sum(axis=1)
        expected += shares @ np.array([row[2] for row in rows])
    if not expected.any():
        return np.zeros(len(near))
    return around(missed / np.maximum(expected, expected.max() * LEAST), near)


def around(squares: Array, places: Array) -> Array:
    """Mean squares (n,) about each of the places (n, 3), partly of the whole body."""
    pairs = cKDTree(places).query_pairs(REACH, output_type="ndarray")
    n = len(places)
    graph = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n))
    graph = graph + graph.T + sparse.identity(n)
    local = (graph @ squares) / np.asarray(graph.sum(axis=1)).ravel()
    return (1 - POOLED) * local + POOLED * squares.mean()
