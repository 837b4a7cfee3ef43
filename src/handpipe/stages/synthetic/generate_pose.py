"""Volume, seeds, scan and truth of one pose of a generated subject."""

from __future__ import annotations

from handpipe.core.configuration import Dataset
from handpipe.synthetic import generators


def generate_pose(dataset: Dataset, pose: str) -> None:
    """Volume, seeds, scan and truth of one pose of a generated subject."""
    generators.generator_of(dataset).generate_pose(dataset, pose)
