"""The examples of docs/fem.md run and do what their text says."""

import re
from pathlib import Path

import numpy as np

TEXT = (Path(__file__).parents[2] / "docs" / "fem.md").read_text(encoding="utf-8")


def test_the_falling_bar_falls_and_shortens():
    """The centre of mass falls as a free body's by implicit Euler, whatever the bar does to itself."""
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)[:2]:
        exec(block, names)
    moved, vertices, mass = names["moved"], names["vertices"], names["mass"]
    weights = np.asarray(mass.sum(axis=1)).ravel()
    fallen = weights @ (moved - vertices) / weights.sum()
    steps, time_step = 5, 1e-3
    expected = 0.5 * steps * (steps + 1) * time_step**2 * names["gravity"]
    np.testing.assert_allclose(fallen, expected, atol=1e-5)
    assert np.ptp(moved[:, 0]) < 0.95 * np.ptp(vertices[:, 0])


def test_the_example_contracts_rests_and_converges():
    names: dict = {}
    exec(re.search(r"```python\n(.*?)```", TEXT, re.DOTALL).group(1), names)
    shape, vertices = names["shape"], names["vertices"]
    assert names["record"].converged
    assert np.ptp(shape[:, 0]) < 0.75 * np.ptp(vertices[:, 0])
    lowest = shape[names["lowest"], 2]
    assert -0.2 < lowest.min() < 0.0
    balance = (
        names["springs"].gradient(shape) + names["plane"].gradient(shape) + names["weight"].gradient(shape)
    )
    np.testing.assert_allclose(balance.sum(axis=0), 0.0, atol=1e-4)
