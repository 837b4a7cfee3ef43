"""Paths of a build's files from patterns."""

from pathlib import Path

import pytest

from handpipe.core import paths


def test_a_path_is_the_pattern_with_its_wildcards() -> None:
    found = paths.at(paths.POSED_TENDON, subject="hand", tendon="flexor2", pose="fist")
    assert found == Path("results/hand/tendons/flexor2/poses/fist.h5")


def test_a_missing_wildcard_raises() -> None:
    with pytest.raises(KeyError, match="pose"):
        paths.at(paths.REGISTRATION, subject="hand")


def test_logs_and_costs_are_named_by_the_wildcards() -> None:
    assert paths.log_of("fit_rig") == "results/{subject}/logs/fit_rig/all.log"
    assert paths.cost_of("simulate", "scene", "chunk") == (
        "results/{subject}/benchmarks/simulate/{scene}/{chunk}.tsv"
    )


def test_figures_of_a_stage_keep_its_wildcards() -> None:
    assert paths.metrics_of("frames-{scene}") == "results/{subject}/metrics/frames-{scene}.json"


def test_partial_chunk_is_beside_its_chunk() -> None:
    assert paths.partial_chunk("a/frames-frames-/frames-3.h5") == Path("a/frames-frames-/partial-3.h5")


def test_no_two_patterns_are_the_same() -> None:
    patterns = [v for k, v in vars(paths).items() if k.isupper()]
    assert len(patterns) == len(set(patterns))
