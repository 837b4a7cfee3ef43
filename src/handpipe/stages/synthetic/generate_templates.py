"""Templates, tendon curves and nails of a generated subject."""

from __future__ import annotations

from handpipe.config import Dataset
from handpipe.datasets import generators


def generate_templates(dataset: Dataset) -> None:
    """Templates, tendon curves and nails of a generated subject."""
    generators.of(dataset).generate_templates(dataset)
