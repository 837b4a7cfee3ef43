"""Seeds of one pose of a generated subject, drawn into its true bones."""

from __future__ import annotations

from handpipe.core.configuration import Dataset
from handpipe.synthetic.acquisition import draw


def generate_seeds(dataset: Dataset, pose: str) -> None:
    """Seeds of one pose of a generated subject, drawn into its true bones."""
    draw(dataset, pose)
