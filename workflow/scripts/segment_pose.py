"""Marrow probability of every bone in one pose, each in a region around its seeds."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.errors import InputError
    from handpipe.imaging.claims import save, segment
    from handpipe.imaging.segmentation import SegmentationSettings, check_seeds
    from handpipe.imaging.volume import pose_volume, read_labels

    dataset = dataset_of(snakemake)
    pose, path = snakemake.wildcards.pose, snakemake.input.seeds
    volume = pose_volume(dataset, pose)
    bones = dataset.labels
    seeds = read_labels(path, volume, dataset.seed_labels)
    drawn = dataset.poses[pose].seeds is not None  # else proposed, but for bones that a person has to look at
    check_seeds(path, seeds, bones, snakemake.params.scribbled if drawn else bones, dataset.other_labels)
    found, wrong = segment(volume, seeds, bones, SegmentationSettings())
    missing = [name for name in wrong if name not in snakemake.params.scribbled]
    if pose == dataset.neutral and missing:
        problem = "; ".join(f"{name}: {wrong[name]}" for name in missing)
        raise InputError(path, "seeds", problem, "Draw the strokes of every bone in its marrow")
    save(snakemake.output[0], found, [*snakemake.input])
