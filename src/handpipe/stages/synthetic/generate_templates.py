"""Templates, tendon curves and nails of a generated subject."""

from __future__ import annotations

from handpipe.core.configuration import Dataset
from handpipe.synthetic import generators


def generate_templates(dataset: Dataset) -> None:
    """Templates, tendon curves and nails of a generated subject."""
    generators.generator_of(dataset).generate_templates(dataset)
