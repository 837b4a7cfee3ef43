"""Scenes in motion in the plan of a build: one expansion a scene, as many chunks as their frames need."""

from collections.abc import Iterator

import pytest
import yaml
from benchmarks.trust.stale import Workbench, workbench
from snakemake.exceptions import WorkflowError

FRAMES = {"close-fist": 132, "thumb-opposition": 996, "numbers": 360, "sign-letters": 732}
CHUNK = {"close-fist": 22, "thumb-opposition": 24, "numbers": 24, "sign-letters": 24}


@pytest.fixture(scope="module")
def bench() -> Iterator[Workbench]:
    with workbench() as made:
        scene = made.folder / "config/scenes/performance.yaml"
        made.write("scenes/absent", yaml.safe_load(scene.read_text()) | {"frames": "absent/recording.csv"})
        yield made


def jobs(bench: Workbench, rule: str, **config: object) -> list[dict[str, str]]:
    found = bench.plan("phantom-hand-preview", **config).compared
    return [dict(job.wildcards) for job in found if job.rule == rule]


def test_shipped_motions_are_cut_into_chunks_of_their_frames(bench: Workbench) -> None:
    scenes = [*FRAMES, "absent"]  # the recording of the last one is not there: it is skipped
    plan = bench.plan("phantom-hand-preview", scenes=scenes).compared
    of = {rule: [dict(j.wildcards) for j in plan if j.rule == rule] for rule in ("expand_motion", "simulate")}
    assert sorted(w["scene"] for w in of["expand_motion"]) == sorted(FRAMES)
    for name, count in FRAMES.items():
        assert sum(w["scene"] == name for w in of["simulate"]) == -(-count // CHUNK[name])
    assert len(of["simulate"]) == sum(-(-count // CHUNK[name]) for name, count in FRAMES.items())


def test_a_chunk_goes_on_from_the_one_before_where_frames_follow_one_another(bench: Workbench) -> None:
    """One job after another, in their order; without `follow` all of them can run at once."""
    given = {"layers": ["bones"], "frames": "config/scenes/numbers.csv", "chunk": 120}
    for name, follow in (("chain", True), ("apart", False)):
        bench.write(f"scenes/{name}", {**given, "follow": follow})
        needs = bench.plan("phantom-hand-preview", scenes=[name]).needs
        before = {
            dict(job.wildcards)["chunk"]: [dict(n.wildcards)["chunk"] for n in those if n.rule == "simulate"]
            for job, those in needs.items()
            if job.rule == "simulate"
        }
        chain: dict[str, list[str]] = {"0": [], "1": ["0"], "2": ["1"]}
        assert before == (chain if follow else dict.fromkeys(chain, []))


def test_frames_that_follow_one_another_take_two_processes_where_they_have_fat(bench: Workbench) -> None:
    given = {"frames": "config/scenes/numbers.csv", "chunk": 360}
    threads = {}
    for name, layers, follow in (
        ("following", ["bones", "fat"], True),
        ("alone", ["bones", "fat"], False),
        ("rigid", ["bones"], True),
    ):
        bench.write(f"scenes/{name}", {**given, "layers": layers, "follow": follow})
        found = bench.plan("phantom-hand-preview", scenes=[name]).threads
        [threads[name]] = {count for job, count in found.items() if job.rule == "simulate"}
    assert threads == {"following": 2, "alone": 1, "rigid": 1}


def test_a_build_of_absent_recordings_alone_is_refused(bench: Workbench) -> None:
    with pytest.raises(WorkflowError, match="the recording of every scene is absent"):
        bench.plan("phantom-hand-preview", scenes=["absent"])


def test_a_recording_that_is_there_is_expanded_and_its_filter_reruns_that(bench: Workbench) -> None:
    scene = {"layers": ["bones"], "frames": "waves.csv", "recording": {"rate": 50, "count": 9}, "chunk": 4}
    bench.write("scenes/waves", scene)
    before = bench.plan("phantom-hand-preview", scenes=["waves"])
    assert sum(job.rule == "simulate" for job in before.compared) == 3
    bench.write("scenes/waves", {**scene, "recording": {**scene["recording"], "smooth": 0.1}})
    after = bench.plan("phantom-hand-preview", scenes=["waves"])
    assert {job.rule for job in after.changed(before)} == {"expand_motion"}


def test_frames_as_such_need_no_expansion(bench: Workbench) -> None:
    assert not jobs(bench, "expand_motion", scenes=["hand-preview"])
