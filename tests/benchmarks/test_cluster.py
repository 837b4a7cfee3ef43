"""Simulated clusters against schedules that can be made by hand; the groups of the Slurm profile."""

from graphlib import CycleError
from pathlib import Path

import pytest
from benchmarks.cluster.__main__ import COSTS, PROFILE, main
from benchmarks.cluster.cases import ALL_FIVE, TEN_TIMES, cases, figures, jobs_of, sequence
from benchmarks.cluster.groups import Groups, grouped, submissions
from benchmarks.cluster.measured import Measured, direct_needs
from benchmarks.cluster.schedule import Costs, Work, least, longest_chain, makespan
from benchmarks.trust.job_plans import JobName, JobPlan
from benchmarks.trust.stale import workbench

from handpipe.core import metrics

SHORT = 10.0  # s
FREE = Costs()
# a: 0 to 3, c: 0 to 4, b: 3 to 5, d: 5 to 6 on two workers
KNOWN = Work({"a": 3, "b": 2, "c": 4, "d": 1}, {"b": frozenset("a"), "d": frozenset("bc")})


@pytest.fixture(scope="module")
def measured() -> Measured:
    return Measured.read()


@pytest.mark.parametrize(
    ("workers", "costs", "seconds"),
    [
        (1, FREE, 10),
        (2, FREE, 6),
        (9, FREE, 6),
        (1, Costs(start=1), 14),
        (2, Costs(start=1), 9),
        (2, Costs(notice=1), 8),
    ],
)
def test_a_graph_of_jobs_ends_when_it_ends_by_hand(workers: int, costs: Costs, seconds: float) -> None:
    assert makespan(KNOWN, workers, costs) == seconds


def test_a_queue_that_does_not_know_lengths_is_above_the_least_time() -> None:
    work = Work({"a": 1, "b": 1, "c": 2})  # at best c beside a and b
    assert (makespan(work, 2, FREE), least(work, 2, FREE)) == (3, 2)
    assert least(work, 1, Costs(start=2)) == 10
    assert longest_chain(KNOWN, Costs(start=1, notice=2)) == 3 + 2 + 1 + 3 + 2 * 2


@pytest.mark.parametrize("workers", [1, 7, 10, 100])
def test_equal_jobs_come_in_rounds(workers: int) -> None:
    work = jobs_of([2.0] * 100, 4, loading=3.0)
    assert len(work.seconds) == 25
    assert makespan(work, workers, Costs(start=1)) == -(-25 // workers) * 12.0


def test_a_last_chunk_has_the_frames_that_are_left() -> None:
    assert jobs_of([1.0, 2.0, 4.0], 2, loading=0.5).seconds == {"simulate/0": 3.5, "simulate/1": 4.5}


def test_jobs_that_wait_for_one_another_are_refused() -> None:
    with pytest.raises(CycleError):
        longest_chain(Work({"a": 1, "b": 1}, {"a": frozenset("b"), "b": frozenset("a")}), FREE)


def test_groups_are_connected_jobs_so_many_at_a_time() -> None:
    needs = {"fit/1": {"cut/1"}, "fit/2": {"cut/2"}, "long": {"fit/1", "fit/2", "fit/3"}}
    work = Work(dict.fromkeys(["cut/1", "cut/2", "fit/1", "fit/2", "fit/3", "long"], 2.0), needs)
    pairs = Groups({"cut": "g", "fit": "g"}, {"g": 2})
    parts = [("cut/1", "fit/1", "cut/2", "fit/2"), ("fit/3",)]
    assert sorted(map(sorted, submissions(work, pairs))) == sorted(map(sorted, [*parts, ("long",)]))
    together = grouped(work, pairs)
    assert sorted(together.seconds.values()) == [2.0, 2.0, 8.0]
    assert makespan(together, 2, FREE) == 10.0
    around = Groups({"cut": "g", "long": "g"}, {"g": 9})  # fit is between
    with pytest.raises(CycleError):
        longest_chain(grouped(work, around), FREE)


def test_needs_that_follow_from_others_are_left_out() -> None:
    a, b, c, all_ = (JobName(rule, ()) for rule in ("a", "b", "c", "all"))
    needs = {a: set(), b: {a}, c: {a, b}, all_: {a, b, c}}
    costs = {job: Path(f"results/phantom-hand-preview/benchmarks/{job.rule}/x.tsv") for job in (c, b, a)}
    plan = JobPlan({}, {job: frozenset(found) for job, found in needs.items()}, costs)
    assert direct_needs(plan) == {"a/x": [], "b/x": ["a/x"], "c/x": ["b/x"]}


@pytest.mark.parametrize(("count", "workers_of"), [(ALL_FIVE, (1, 10, 100)), (TEN_TIMES, (1, 10, 100, 1000))])
def test_ten_times_as_many_workers_are_close_to_ten_times_as_fast(
    measured: Measured, count: int, workers_of: tuple[int, ...]
) -> None:
    work = jobs_of(sequence(measured, count), 1, measured.loading)
    seconds = [makespan(work, workers, COSTS) for workers in workers_of]
    gains = [a / b for a, b in zip(seconds, seconds[1:], strict=False)]
    assert all(9.5 < gain <= 10.0 + 1e-9 for gain in gains), gains


def test_no_simulated_time_is_below_the_least(measured: Measured) -> None:
    for case in cases(measured, Groups.read(PROFILE)):
        found = figures(case, COSTS)
        for name, (seconds, _) in found.items():
            if name.endswith("_seconds"):
                assert seconds >= found[f"{name}_least"][0] - 1e-6, name


def test_figures_table_and_picture(tmp_path: Path) -> None:
    main(["--output", str(tmp_path / "cluster.json"), "--start", "0", "--notice", "0"])
    found = metrics.read(tmp_path / "cluster.json")
    assert found["start"] == (0.0, "s")
    assert found["build_workers1_share"][0] == pytest.approx(1.0)
    text = (tmp_path / "cluster.md").read_text(encoding="utf-8")
    assert f"| whole build, jobs alone | {found['build_jobs'][0]:.0f} |" in text
    assert "<svg" in (tmp_path / "cluster.svg").read_text(encoding="utf-8")


def test_every_short_rule_of_the_hand_is_in_a_group(measured: Measured) -> None:
    groups = Groups.read(PROFILE)
    short = {rule for rule, seconds in measured.rules().items() if sum(seconds) / len(seconds) < SHORT}
    assert {"fit_ligament", "evaluate_skin"} <= short
    assert short - groups.of_rule.keys() == set()


def test_submissions_of_the_hand_are_few_and_none_is_short(measured: Measured) -> None:
    work = measured.build()
    together = grouped(work, Groups.read(PROFILE))
    assert len(work.seconds) == 173 and len(together.seconds) == 82
    assert sum(together.seconds.values()) == pytest.approx(sum(work.seconds.values()))
    left = [job for job, seconds in together.seconds.items() if seconds < SHORT]
    assert len(left) == 6  # of rules whose other jobs are longer
    assert {job.partition("/")[0] for job in left} == {"extract_muscle", "register_bones", "simulate_skin"}
    longest_chain(together, FREE)  # no submission waits for itself


@pytest.mark.parametrize("kind", ["phantom-finger", "phantom-hand", "person", "knee"])
def test_no_submission_of_other_subjects_waits_for_itself(kind: str) -> None:
    with workbench() as bench:
        needs = bench.before(kind).needs
    names = {job: "/".join([job.rule, *(value for _, value in job.wildcards)]) for job in needs}
    work = Work(
        dict.fromkeys(names.values(), 1.0),
        {names[job]: {names[need] for need in found} for job, found in needs.items()},
    )
    longest_chain(grouped(work, Groups.read(PROFILE)), FREE)
