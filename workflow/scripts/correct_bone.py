"""Marrow probability of one bone in one pose, with the scribbles that correct it."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.imaging.claims import save
    from handpipe.imaging.segmentation import SegmentationSettings, add_scribbles, check_seeds, segment_bone
    from handpipe.imaging.volume import pose_volume, read_labels

    dataset = dataset_of(snakemake)
    volume = pose_volume(dataset, snakemake.wildcards.pose)
    path, bone = snakemake.input.scribbles, snakemake.wildcards.bone
    drawn = (read_labels(file, volume, dataset.seed_labels) for file in (snakemake.input.seeds, path))
    seeds = add_scribbles(*drawn)
    others = set(dataset.bones) - {bone}
    check_seeds(path, seeds, dataset.labels, others, dataset.other_labels)
    found = segment_bone(volume, seeds, dataset.bones[bone].label, SegmentationSettings())
    save(snakemake.output[0], {bone: found}, [*snakemake.input])
