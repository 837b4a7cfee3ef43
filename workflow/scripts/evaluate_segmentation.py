"""Dice of every bone in every pose against truth: the whole bone in neutral, the marrow elsewhere."""

from pathlib import Path

from common import stage
from figures import stage_cost

with stage(snakemake):
    from handpipe import metrics
    from handpipe.config import load_dataset
    from handpipe.evaluation.surfaces import dice
    from handpipe.imaging.volume import read_labels, read_volume

    dataset = load_dataset(snakemake.input.dataset)
    figures = stage_cost(snakemake, "segment_bone", "merge_labels")
    if dataset.truth is not None:
        folder = dataset.path(dataset.truth.folder)
        overlaps = {}
        for pose, path in zip(dataset.poses, snakemake.input.labels, strict=True):
            part = "bones" if pose == dataset.neutral else "marrow"
            volume = read_volume(dataset.path(dataset.poses[pose].volume))
            labels, truth = (read_labels(p, volume) for p in (path, folder / f"{pose}.{part}.nii.gz"))
            overlaps |= {
                f"dice_{pose}_{name}": dice(labels, truth, b.label) for name, b in dataset.bones.items()
            }
        figures |= {name: (value, "1") for name, value in overlaps.items()}
        figures["dice_mean"] = (sum(overlaps.values()) / len(overlaps), "1")
        figures["dice_min"] = (min(overlaps.values()), "1")
    metrics.write(Path(snakemake.output[0]), figures)
