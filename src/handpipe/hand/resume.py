"""What simulated frames were made of, so that only frames of the same input and code are used again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from handpipe.core import identity


def key_of(inputs: Sequence[str | Path], parameters: Mapping[str, str | Sequence[str]]) -> str:
    """A digest of input files and of the parameters of the job, among them the digest of its code."""
    said = {"inputs": [identity(path) for path in inputs], "parameters": dict(parameters)}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
