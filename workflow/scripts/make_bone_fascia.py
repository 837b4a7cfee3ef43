"""The cloth around the bones, and how each of its vertices is held."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe.fascia.fascia import ClothSettings, Fascia
    from handpipe.fascia.regions import read_regions
    from handpipe.fascia.wrapping import bone_wrap
    from handpipe.skeleton.layer import bone_regions
    from handpipe.skeleton.rig import Rig

    dataset = dataset_of(snakemake)
    bones = Rig.load(snakemake.input.rig).surfaces
    joints = [(j.parent, j.child) for j in dataset.joints.values()]
    surface = bone_wrap(bones, joints, snakemake.params.edge)
    regions = bone_regions(surface.vertices, bones, joint_radius=5.0, tolerance=1.0)
    if painted := snakemake.input.get("regions"):
        regions = read_regions(painted, len(surface.vertices))
    log.info("%d vertices, %d of them fixed", len(regions), (regions > 0).sum())
    cloth = ClothSettings(shrink=0.35)
    Fascia.around("bone_fascia", surface, regions, bones, cloth).save(snakemake.output[0], [*snakemake.input])
