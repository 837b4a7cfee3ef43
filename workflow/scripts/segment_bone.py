"""Marrow probability of one bone in one pose, in a region around its seeds."""

from common import stage

with stage(snakemake):
    from handpipe.config import load_dataset
    from handpipe.imaging.segmentation import SegmentationSettings, add_scribbles, check_seeds, segment_bone
    from handpipe.imaging.volume import read_labels, read_volume

    dataset = load_dataset(snakemake.input.dataset)
    volume = read_volume(snakemake.input.volume)
    seeds = read_labels(snakemake.input.seeds, volume)
    check_seeds(snakemake.input.seeds, seeds, {name: bone.label for name, bone in dataset.bones.items()})
    if scribbles := snakemake.input.get("scribbles"):
        seeds = add_scribbles(seeds, read_labels(scribbles, volume))
    label = dataset.bones[snakemake.wildcards.bone].label
    segment_bone(volume, seeds, label, SegmentationSettings()).save(snakemake.output[0], [*snakemake.input])
