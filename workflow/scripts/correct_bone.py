"""Marrow probability of one bone in one pose, with the scribbles that correct it."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.imaging.claims import save
    from handpipe.imaging.segmentation import SegmentationSettings, add_scribbles, check_seeds, segment_bone
    from handpipe.imaging.volume import read_labels, read_volume

    dataset = dataset_of(snakemake)
    volume = read_volume(snakemake.input.volume)
    path, bone = snakemake.input.scribbles, snakemake.wildcards.bone
    seeds = add_scribbles(read_labels(snakemake.input.seeds, volume), read_labels(path, volume))
    others = set(dataset.bones) - {bone}
    check_seeds(path, seeds, {name: b.label for name, b in dataset.bones.items()}, others)
    found = segment_bone(volume, seeds, dataset.bones[bone].label, SegmentationSettings())
    save(snakemake.output[0], {bone: found}, [*snakemake.input])
