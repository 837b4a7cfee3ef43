"""Digest of inputs and code, so that a resumed run reuses only frames of the same inputs and code."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from handpipe.core import identity


def key_of(inputs: Sequence[str | Path], parameters: Mapping[str, str | Sequence[str]]) -> str:
    """Digest of the inputs of a job.

    Parameters
    ----------
    inputs : sequence of path
        Input files.
    parameters : mapping of str to str or sequence of str
        Parameters of the job, among them the digest of its code.

    Returns
    -------
    str
        SHA-256 in hexadecimal digits.
    """
    said = {"inputs": [identity(path) for path in inputs], "parameters": dict(parameters)}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()
