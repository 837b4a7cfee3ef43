"""Labels of a pose without conflicts between bones, and the bones' surfaces."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe.errors import InputError
    from handpipe.imaging import claims
    from handpipe.imaging.cortical import whole_bone
    from handpipe.imaging.marrow import marrow_surface
    from handpipe.imaging.rasterise import rasterise
    from handpipe.imaging.segmentation import SegmentationSettings, add_scribbles, merge
    from handpipe.imaging.volume import pose_volume, read_labels, write_labels
    from handpipe.skeleton.bones import write_surfaces
    from handpipe.skeleton.neutral_doubts import neutral_doubts

    dataset = dataset_of(snakemake)
    pose = snakemake.wildcards.pose
    volume = pose_volume(dataset, pose)
    table = dataset.labels
    seeds = read_labels(snakemake.input.seeds, volume, dataset.seed_labels)
    corrected = dataset.poses[pose].scribbles
    for name, path in zip(corrected, snakemake.input.scribbles, strict=True):
        seeds = add_scribbles(
            seeds, read_labels(path, volume, dataset.seed_labels), dataset.bones[name].label
        )
    names = {label: name for name, label in table.items()}

    found = claims.load(snakemake.input.bones, snakemake.input.corrected)
    _, merged = merge(
        volume, {table[name]: bone for name, bone in found.items()}, seeds, SegmentationSettings()
    )
    bones = {names[label]: bone for label, bone in merged.items()}
    looks = claims.appearances(volume, bones)
    neutral = claims.read_looks(snakemake.input.neutral)[0] if snakemake.input.neutral else {}
    left_out = {name: "it has no seeds in its marrow" for name in table if name not in bones}
    left_out |= claims.doubted(looks, neutral, corrected)
    marrows = {name: marrow_surface(volume, b) for name, b in bones.items() if name not in left_out}
    if pose == dataset.neutral:
        for name, reason in neutral_doubts(marrows, dataset.joints).items():
            log.warning("%s: doubted, since %s", name, reason)
            if name not in corrected:
                left_out[name] = reason
    if left_out and pose == dataset.neutral:
        problem = "; ".join(f"{name}: {reason}" for name, reason in left_out.items())
        remedy = f"Mend its strokes, or name a label volume of more under poses.{pose}.scribbles"
        raise InputError(snakemake.input.seeds, "seeds", problem, remedy)
    for name, reason in left_out.items():
        log.warning("%s is left out: %s", name, reason)
    bones = {name: bone for name, bone in bones.items() if name not in left_out}

    surfaces = {name: {"marrow": marrow} for name, marrow in marrows.items()}
    if pose == dataset.neutral:
        for name, marrow in marrows.items():
            others = [marrows[other] for other in marrows if other != name]
            surfaces[name]["whole"] = whole_bone(volume, bones[name], marrow, others)
    for name, parts in surfaces.items():
        log.info("%s: marrow of %.0f mm^3", name, parts["marrow"].volume())
    outermost = {table[name]: parts.get("whole", parts["marrow"]) for name, parts in surfaces.items()}
    write_labels(snakemake.output.labels, rasterise(volume, outermost), volume.affine, table)
    claims.write_looks(snakemake.output.looks, looks, left_out)
    write_surfaces(snakemake.output.surfaces, surfaces, [*snakemake.input])
