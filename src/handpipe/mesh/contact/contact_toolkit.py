"""The IPC Toolkit with one thread: with several, the order of its sums differs from run to run."""

from __future__ import annotations

import ipctk

__all__ = ["ipctk"]

# Rules declare one thread, and builds of the same inputs give the same bits.
ipctk.set_num_threads(1)
