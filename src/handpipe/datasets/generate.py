"""Make the files of a generated dataset, one pose or the templates at a time."""

from __future__ import annotations

from pathlib import Path

from handpipe.config import Dataset
from handpipe.datasets import phantom_finger
from handpipe.errors import InputError


def generate(dataset: Dataset, pose: str | None) -> None:
    """Write one pose's files, or for None those of no pose (templates, attachments, curves, nail patches).

    Raises `InputError` for a dataset without generator or a pose that its generator does not know.
    """
    if dataset.generator != "phantom-finger":
        raise InputError(
            dataset.name, "generator", f"is {dataset.generator!r}", "Nothing generates this dataset"
        )
    if pose is None:
        phantom_finger.generate_templates(dataset)
    else:
        phantom_finger.generate_pose(dataset, pose)


def outputs(dataset: Dataset, pose: str | None) -> list[Path]:
    """The files that `generate` writes."""
    if pose is None:
        organs = [*dataset.muscles.values(), *dataset.ligaments.values()]
        files = [b.template for b in dataset.bones.values() if b.template is not None]
        files += [path for organ in organs for path in (organ.template, organ.attachments)]
        files += [t.path for t in dataset.tendons.values()] + [n.surface for n in dataset.nails.values()]
    else:
        acquired = dataset.poses[pose]
        files = [p for p in (acquired.volume, acquired.seeds, acquired.scan) if p is not None]
        if dataset.truth is not None:
            files += [
                dataset.truth.folder / f"{pose}{end}" for end in (".h5", ".bones.nii.gz", ".marrow.nii.gz")
            ]
    return [dataset.path(f) for f in files]
