"""Contact that is renewed until a shape rests, on maps whose fixed points are known."""

import logging

import numpy as np
import pytest

from handpipe.core.errors import ConvergenceError
from handpipe.fem.minimisation.record import Equilibrium, Record
from handpipe.fem.solver import settling
from handpipe.fem.solver.settling import Limits, root_mean_square

LIMITS = Limits(renewals=20, settled=0.01, gross=0.4)
GOAL = np.array([[1.0, -2.0, 0.5], [0.0, 3.0, 1.0]])
START = np.zeros_like(GOAL)


def settle(equilibrium, *arguments, **options):
    """`settling.settle` of a map from positions to positions."""
    return settling.settle(
        lambda x, enough: Equilibrium(equilibrium(x, enough), Record()), *arguments, **options
    )


def towards_goal(rate):
    """A map that leaves `rate` of the distance to the goal, on the other side where it is negative."""
    return lambda x, _: GOAL + rate * (x - GOAL)


@pytest.mark.parametrize("rate", [0.0, 0.5, -0.5, -0.98, -1.0])
def test_a_shape_that_can_rest_comes_to_its_fixed_point(rate):
    settled = settle(towards_goal(rate), START, LIMITS, "body")
    assert settled.rests and settled.motion < 0.01
    # motion / (1 - rate) is how far from the fixed point planes were taken; the map leaves `rate` of it.
    distance = np.linalg.norm(settled.x - GOAL, axis=1).max()
    assert distance == pytest.approx(settled.motion * abs(rate) / (1 - rate), abs=1e-9)
    assert settled.figures["contact_unsettled"] == 0


def test_a_long_way_in_equal_steps_is_gone_to_its_end():
    """Contact that takes depth away bit by bit moves a shape by as much each time: that is no cycle."""

    def bitten(x, _):
        way = GOAL - x
        lengths = np.linalg.norm(way, axis=1, keepdims=True)
        return x + way * np.minimum(0.25 / np.maximum(lengths, 1e-12), 1.0)

    settled = settle(bitten, START, LIMITS, "body")
    farthest = np.linalg.norm(GOAL, axis=1).max()
    assert settled.rests and settled.x == pytest.approx(GOAL)
    assert settled.renewals == int(np.ceil(farthest / 0.25)) + 1


def test_a_part_that_alternates_is_damped_while_another_goes_on():
    """The second point alternates; the first goes on in steps of 0.25 mm, and takes whole steps."""
    goal = np.array([[4.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

    def mixed(x, _):
        first = x[0] + np.clip(goal[0] - x[0], -0.25, 0.25)
        return np.array([first, goal[1] - 1.5 * (x[1] - goal[1])])

    settled = settle(mixed, START, LIMITS, "bodies", parts=[slice(0, 1), slice(1, 2)])
    assert settled.rests and settled.renewals == 17  # sixteen steps, and one to see that it rests
    assert settled.x == pytest.approx(goal, abs=0.01)
    assert not settle(mixed, START, LIMITS, "bodies").rests  # one share for both goes down and up


def test_a_step_without_renewal_is_one_renewal():
    settled = settle(towards_goal(0.0), GOAL, LIMITS, "body")
    assert (settled.renewals, settled.motion) == (1, 0.0)


def test_solves_before_the_last_end_early_and_the_last_one_does_not():
    """Each solve halves its distance from its own solution until it is told that it is near enough."""
    solutions, ends = towards_goal(0.5), []

    def solve(told):
        def halving(x, enough):
            solution, place = solutions(x, None), x
            count = 0
            while count < 40:
                step = 0.5 * (solution - place)
                place, count = place + step, count + 1
                if told and enough is not None and enough(place, step):
                    break
            ends.append((count, np.linalg.norm(place - solution, axis=1).max()))
            return place

        ends.clear()
        return settle(halving, START, LIMITS, "body")

    exact = solve(told=False)
    assert [count for count, _ in ends] == [40] * exact.renewals
    early = solve(told=True)
    counts, errors = zip(*ends, strict=True)
    first = LIMITS.renewals // 4
    assert early.rests and early.x == pytest.approx(exact.x, abs=0.01)
    assert max(counts[:first]) < 15 and max(errors[:first]) < 0.5 * LIMITS.settled
    assert set(counts[first:]) == {40} and max(errors[first:]) < 1e-9


def test_where_nothing_rests_no_result_is_of_a_solve_that_ended_early():
    """The first quarter of the renewals moves less, but those solves were told to end early.

    As many solves are exact as without them.
    """

    def restless(x, enough):
        motion = np.zeros_like(x)
        motion[:, 0] = 0.3 if enough is None else 0.02
        if enough is not None:
            assert enough(x + motion, 0.1 * motion)
        return x + motion

    settled = settle(restless, START, LIMITS, "body")
    first = LIMITS.renewals // 4
    assert settled.motion == pytest.approx(0.3) and settled.chosen > first
    assert settled.renewals - first == LIMITS.renewals


def test_what_never_rests_is_warned_of_and_the_least_motion_taken(caplog):
    motions = iter([0.3, 0.2, 0.05, 0.3, 0.2] * 4)
    steps = []

    def restless(x, _):
        steps.append(next(motions))
        return x + [steps[-1], 0.0, 0.0]

    with caplog.at_level(logging.WARNING):
        settled = settle(restless, START, LIMITS, "restless body")
    assert len(steps) == settled.renewals == 20
    assert settled.motion == pytest.approx(0.05) and not settled.rests
    assert "restless body: not settled, motion 0.050 mm in 20 renewals" in caplog.text
    assert settled.figures == {
        "contact_renewals": 20.0,
        "contact_motion": settled.motion,
        "contact_unsettled": 1.0,
    }


def test_a_gross_motion_is_no_result():
    with pytest.raises(ConvergenceError, match=r"body did not converge: it moves by 0\.50 mm"):
        settle(lambda x, _: x + [0.0, 0.5, 0.0], START, LIMITS, "body")


def test_an_error_names_what_moves_most():
    with pytest.raises(ConvergenceError, match="most of all the second point"):
        settle(
            lambda x, _: x + [[0.0, 0.5, 0.0], [0.0, 0.7, 0.0]],
            START,
            LIMITS,
            "body",
            mover=lambda motion: ["the first point", "the second point"][int(np.argmax(motion[:, 1]))],
        )


def test_root_mean_square_is_that_of_lengths():
    motion = np.array([[3.0, 0.0, 4.0], [0.0, 1.0, 0.0]])
    settled = settle(lambda x, _: x + motion, START, Limits(1, 0.0, 9.0), "body", root_mean_square)
    assert settled.motion == pytest.approx(np.sqrt((25 + 1) / 2))
