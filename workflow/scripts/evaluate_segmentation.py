"""How the bones look in every pose; Dice against truth: the whole bone in neutral, the marrow elsewhere."""

from pathlib import Path

from common import dataset_of, stage
from figures import pose_cost, stage_cost

RULES = ("segment_pose", "correct_bone", "merge_labels")

with stage(snakemake) as log:
    from handpipe import metrics
    from handpipe.evaluation.segmentation import looks_figures
    from handpipe.evaluation.surfaces import dice
    from handpipe.imaging.claims import read_looks
    from handpipe.imaging.volume import read_labels, read_volume

    dataset = dataset_of(snakemake)
    figures = stage_cost(snakemake, *RULES) | pose_cost(snakemake, dataset.poses, *RULES)
    read = {p: read_looks(f) for p, f in zip(dataset.poses, snakemake.input.looks, strict=True)}
    looks, left_out = ({pose: parts[i] for pose, parts in read.items()} for i in range(2))
    figures |= looks_figures(looks, left_out, dataset.neutral)
    for pose, bones in left_out.items():
        for name, reason in bones.items():
            log.warning("%s in %s is left out: %s", name, pose, reason)
    if dataset.truth is not None:
        folder = dataset.path(dataset.truth.folder)
        overlaps = {}
        for pose, path in zip(dataset.poses, snakemake.input.labels, strict=True):
            part = "bones" if pose == dataset.neutral else "marrow"
            labels = read_labels(path)
            truth = read_labels(folder / f"{pose}.{part}.nii.gz", read_volume(path))
            overlaps |= {
                f"dice_{pose}_{name}": dice(labels, truth, b.label) for name, b in dataset.bones.items()
            }
        figures |= {name: (value, "1") for name, value in overlaps.items()}
        figures["dice_mean"] = (sum(overlaps.values()) / len(overlaps), "1")
        figures["dice_min"] = (min(overlaps.values()), "1")
    metrics.write(Path(snakemake.output[0]), figures)
