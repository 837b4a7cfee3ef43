"""What a page sends: JSON, points, objects inside of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import Array, InputError


def given_json(target: Path, content: bytes) -> Any:
    """What a page sent as its content."""
    try:
        return json.loads(content)
    except ValueError as error:
        raise InputError(target, "edit", "is no JSON", "Load the page again") from error


def given_vector(target: Path, field: str, given: Any) -> Array:
    """Three finite numbers (3,) that a page sent."""
    try:
        vector = np.array(given, dtype=float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(target, field, f"{given} is no point", "Load the page again")
    return vector


def each_with(key: str, content: Any, replaced: Callable[[Mapping[str, Any]], Any]) -> Any:
    """JSON in which every object that has a key is replaced."""
    if isinstance(content, list):
        return [each_with(key, x, replaced) for x in content]
    if not isinstance(content, dict):
        return content
    if key in content:
        return replaced(content)
    return {name: each_with(key, value, replaced) for name, value in content.items()}
