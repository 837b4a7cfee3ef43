"""Costly test files first: each is run by one process, and one that is begun last would run alone."""

import pytest

COSTLY = (  # from a minute of processor on, the dearest first; `pytest --durations=0` tells
    "workflow/test_build.py",
    "workflow/test_declared_files.py",
    "workflow/test_declared_truth.py",
    "workflow/test_only_what_is_needed.py",
    "workflow/test_changes.py",
    "workflow/test_command.py",
    "workflow/test_levels.py",
    "workflow/test_views.py",
    "cli/test_real_wrist.py",
    "benchmarks/test_chain_effects.py",
    "benchmarks/test_bones_hard_cases.py",
    "workflow/test_cache.py",
    "docs/test_scans_to_hand.py",
    "anatomy/test_template_hand.py",
    "imaging/test_learned_foot.py",
    "synthetic/test_family.py",
    "cli/test_person.py",
    "anatomy/test_family.py",
)
RANK = {f"tests/{name}": number for number, name in enumerate(COSTLY)}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order tests by their files. The Makefile keeps pytest-xdist from reordering them."""
    items.sort(key=lambda item: RANK.get(item.nodeid.partition("::")[0], len(RANK)))
