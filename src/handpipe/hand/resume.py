"""What simulated frames were made of, so that only frames of the same input and code are used again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from handpipe import artifacts


def key_of(inputs: Sequence[str | Path], layers: Sequence[str]) -> str:
    """A digest of input files, the layers' names and the code of the package."""
    said = {
        "inputs": [artifacts.content_hash(path) for path in inputs],
        "layers": list(layers),
        "code": _code(),
    }
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()


def _code() -> str:
    """A digest of the package's Python files."""
    folder = Path(artifacts.__file__).parent
    files = sorted(folder.rglob("*.py"))
    return hashlib.sha256(
        "".join(f"{f.relative_to(folder)} {artifacts.content_hash(f)}\n" for f in files).encode()
    ).hexdigest()
