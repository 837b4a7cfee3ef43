"""How many threads the numerical libraries of a benchmark's process take."""

from __future__ import annotations

import os
import sys


def take_threads(count: int) -> None:
    """Set the number for libraries that are not loaded yet: they read it when they are."""
    if "numba" not in sys.modules:
        for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
            os.environ[name] = str(count)
