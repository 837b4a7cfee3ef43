"""What interpolation over poses may miss: a variance that grows from the examples, and each one left out.

The quantity is taken as a random function of the pose of which nothing is known but how it changes: it has a
rough part, whose mean square change between two poses is twice their distance, and a linear trend, whose mean
square change is twice the distance's square; all times a scale. The best linear prediction of such a function
is by linear radial functions with a linear part, the "rbf" weights. Where weights stand for another pose than
the one that is asked for, as positive or bounded ones do beyond the examples, they miss the trend.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.posing.pose_space import ALIKE, COINCIDENT, PoseSpace


def prediction_variance(space: PoseSpace, pose: Array) -> float:
    """Mean square error of the interpolation in a pose, of a quantity of scale one.

    It is zero at the examples, and grows without bound with the distance from all of them. A quantity whose
    weights do not sum to one is a correction, of which there is none at rest: the weight that is missing is
    that of the example that is nearest to rest.

    Parameters
    ----------
    space : PoseSpace
        The pose space with its examples and weights.
    pose : array (d,)
        Pose vector.

    Returns
    -------
    float
        In the unit of the space's distances.
    """
    return _variance(space, pose, _completed(space, space.weights_at(pose)))


def left_out_weights(space: PoseSpace) -> Iterator[tuple[int, Array, float]]:
    """Each example but that at rest, predicted from the others.

    Parameters
    ----------
    space : PoseSpace
        The pose space with N examples.

    Yields
    ------
    number : int
        Number of the example.
    weights : array (N,)
        Weights of all examples, zero for its own.
    variance : float
        `prediction_variance` without it.
    """
    for number in range(len(space.examples)):
        others = np.delete(np.arange(len(space.examples)), number)
        if number == _at_rest(space) or not len(others):
            continue
        names = tuple(space.poses[i] for i in others)
        fewer = replace(space, examples=space.examples[others], poses=names)
        weights = np.zeros(len(space.examples))
        weights[others] = fewer.weights_at(space.examples[number])
        completed = _completed(fewer, weights[others])
        yield number, weights, _variance(fewer, space.examples[number], completed)


def _at_rest(space: PoseSpace) -> int:
    return int(np.argmin(np.linalg.norm(space.examples, axis=1)))


def _completed(space: PoseSpace, weights: Array) -> Array:
    completed = weights.copy()
    completed[_at_rest(space)] += 1.0 - weights.sum()
    return completed


def _variance(space: PoseSpace, pose: Array, weights: Array) -> float:
    to_pose = np.linalg.norm(space.examples - pose, axis=1)
    rough = float(2 * weights @ to_pose - weights @ space.between() @ weights)
    trend = 2.0 * float(((pose - weights @ space.examples) ** 2).sum()) / ALIKE
    found = rough + trend
    return found if found > COINCIDENT else 0.0
