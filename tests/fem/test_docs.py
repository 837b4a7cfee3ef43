"""The example of docs/fem.md runs and does what its text says."""

import re
from pathlib import Path

import numpy as np

TEXT = (Path(__file__).parents[2] / "docs" / "fem.md").read_text(encoding="utf-8")


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
