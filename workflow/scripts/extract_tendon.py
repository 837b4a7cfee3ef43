"""A tendon's neutral rod and tube from the volume and a clicked curve."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe import artifacts
    from handpipe.imaging.markers import read_markers
    from handpipe.imaging.volume import pose_volume
    from handpipe.mesh.distance import Distance
    from handpipe.mesh.surface import concatenate
    from handpipe.skeleton.rig import Rig
    from handpipe.tendons.extraction import extract

    dataset = dataset_of(snakemake)
    tendon = dataset.tendons[snakemake.wildcards.tendon]
    rig = Rig.load(snakemake.input.rig)
    clicked, _ = read_markers(dataset.path(tendon.path))
    bones = Distance(concatenate([rig.surfaces[b] for b in tendon.bones]))
    found = extract(pose_volume(dataset, dataset.neutral), clicked, tendon.radius, bones)
    log.info("%d segments, radius %.2f mm", len(found.x) - 1, found.radii.mean())
    data = {
        "x": found.x,
        "radii": found.radii,
        "confidence": found.confidence,
        "tube": {"vertices": found.surface.vertices, "triangles": found.surface.triangles},
    }
    units = dict.fromkeys(("x", "radii", "tube/vertices"), "mm")
    artifacts.write(snakemake.output[0], data, kind="neutral_tendon", units=units, inputs=[*snakemake.input])
