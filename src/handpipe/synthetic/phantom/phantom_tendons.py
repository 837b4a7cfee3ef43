"""The phantom finger's flexor and extensor."""

from __future__ import annotations

import numpy as np

from handpipe.synthetic.geometry.sliding import STEP, KnownTendon


def _tendon(
    name: str, side: float, radius: float, depth: list[tuple[float, float]], length: float
) -> KnownTendon:
    """A tendon in the plane y = 0 by its (x, |z|), last its insertion."""
    knots = np.array(depth)
    x = np.arange(knots[0, 0], knots[-1, 0] + 1e-9, STEP)
    z = side * np.interp(x, knots[:, 0], knots[:, 1])
    return KnownTendon(name, side, radius, np.column_stack([x, np.zeros_like(x), z]), length)


def tendons() -> dict[str, KnownTendon]:
    """Flexor and extensor of the finger."""
    flexor = [(-7.0, 8.6), (20.0, 8.2), (48.0, 8.9), (58.0, 9.4), (66.0, 8.8), (82.0, 6.6), (101.4, 6.9)]
    flexor += [(112.0, 6.0), (118.0, 5.5), (127.0, 5.6), (136.0, 5.0)]
    extensor = [(-7.0, 8.4), (20.0, 7.0), (45.0, 6.9), (54.0, 8.4), (58.2, 8.7), (70.0, 7.6), (80.0, 6.2)]
    extensor += [(95.0, 5.6), (101.4, 5.7), (110.0, 6.1), (117.0, 5.0), (127.0, 4.8), (134.5, 4.9)]
    return {
        "flexor2": _tendon("flexor2", -1.0, 1.8, flexor, 105.5),
        "extensor2": _tendon("extensor2", 1.0, 1.3, extensor, 137.0),
    }
