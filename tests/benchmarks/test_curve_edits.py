"""The figures of edits, on a coarse leg."""

from benchmarks.anatomy import edits


def test_an_edit_is_measured_on_the_leg() -> None:
    found = edits._edits(1.0, 14.0)
    assert found["tets"][0] > 10_000
    seconds = {name: value for name, (value, unit) in found.items() if unit == "s"}
    assert set(seconds) == {
        "opening_seconds",
        "seconds",
        "undo_seconds",
        "spread_seconds",
        "beside_spread_seconds",
    }
    assert all(0 < value < 20 for value in seconds.values())
    assert seconds["undo_seconds"] < seconds["opening_seconds"]  # nothing is factorised again
    assert set(edits.DOMAINS) == {"100k", "640k"}
