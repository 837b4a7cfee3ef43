"""Points that follow bones: dual quaternions of up to four bones a point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, Int32Array, IntArray
from handpipe.hand.exports import BONES_A_VERTEX
from handpipe.levels import kernels


@dataclass(frozen=True, eq=False)
class Followers:
    """Points and the bones that carry them.

    rest (n, 3): neutral places in mm; joints (n, 4): numbers of bones; weights (n, 4): by falling weight.
    """

    rest: Array
    joints: Int32Array
    weights: Array

    @staticmethod
    def of(rest: Array, weights: Array, bones: IntArray) -> Followers:
        """Points (n, 3) with weights (n, k) of bones, given by their numbers (k,); the four largest count."""
        order = np.argsort(-weights, axis=1, kind="stable")[:, :BONES_A_VERTEX]
        chosen = np.take_along_axis(weights, order, axis=1)
        pad = [(0, 0), (0, BONES_A_VERTEX - order.shape[1])]
        joints = np.pad(bones[order], pad).astype(np.int32)
        return Followers(rest, joints, np.pad(chosen / chosen.sum(axis=1, keepdims=True), pad))

    def at(self, rest: Array) -> Followers:
        """Other points (n, 3) that the same bones carry."""
        return Followers(rest, self.joints, self.weights)

    def chosen(self, which: IntArray) -> Followers:
        """Some of the points."""
        return Followers(self.rest[which], self.joints[which], self.weights[which])

    def moved(self, duals: Array) -> Array:
        """Places (n, 3) in mm by dual quaternions (b, 8) of all bones."""
        out = np.empty_like(self.rest)
        kernels.skin_dual(self.rest, self.joints, self.weights, duals, np.arange(len(out)), out)
        return out


def duals_of(motions: Array) -> Array:
    """Dual quaternions (b, 8) of motions (b, 3, 4)."""
    out = np.zeros((len(motions), 8))
    kernels.dual_quaternions(motions, out)
    return out
