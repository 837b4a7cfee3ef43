"""Labels of a pose without conflicts between bones, and the bones' surfaces."""

from common import stage

with stage(snakemake) as log:
    from handpipe.config import load_dataset
    from handpipe.imaging.cortical import whole_bone
    from handpipe.imaging.marrow import marrow_surface
    from handpipe.imaging.rasterise import rasterise
    from handpipe.imaging.segmentation import BoneProbability, SegmentationSettings, merge
    from handpipe.imaging.volume import read_labels, read_volume, write_labels
    from handpipe.skeleton.bones import write_surfaces

    dataset = load_dataset(snakemake.input.dataset)
    settings = SegmentationSettings()
    volume = read_volume(snakemake.input.volume)
    seeds = read_labels(snakemake.input.seeds, volume)
    names = {bone.label: name for name, bone in dataset.bones.items()}
    claims = {
        dataset.bones[name].label: BoneProbability.load(path)
        for name, path in zip(dataset.bones, snakemake.input.bones, strict=True)
    }
    _, bones = merge(volume, claims, seeds, settings)

    marrows = {label: marrow_surface(volume, bone) for label, bone in bones.items()}
    surfaces = {names[label]: {"marrow": marrow} for label, marrow in marrows.items()}
    if snakemake.wildcards.pose == dataset.neutral:
        for label, marrow in marrows.items():
            others = [marrows[other] for other in marrows if other != label]
            surfaces[names[label]]["whole"] = whole_bone(volume, bones[label], marrow, others)
    for name, parts in surfaces.items():
        log.info("%s: marrow of %.0f mm^3", name, parts["marrow"].volume())
    outermost = {dataset.bones[n].label: parts.get("whole", parts["marrow"]) for n, parts in surfaces.items()}
    labels = rasterise(volume, outermost)
    write_labels(
        snakemake.output.labels, labels, volume.affine, {n: b.label for n, b in dataset.bones.items()}
    )
    write_surfaces(snakemake.output.surfaces, surfaces, [*snakemake.input])
