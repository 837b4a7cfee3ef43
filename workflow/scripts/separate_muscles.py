"""Muscles of an example pose without interpenetration (Zheng 2022 §4.4, stage 2)."""

from common import stage

with stage(snakemake) as log:
    from handpipe import artifacts
    from handpipe.mesh.surface import each_moved
    from handpipe.muscles.contested import separate_posed
    from handpipe.skeleton.bones import read_registration
    from handpipe.skeleton.rig import Rig
    from muscle_files import read_bodies

    shapes = artifacts.read(snakemake.input.shapes, "muscle_shapes")[snakemake.wildcards.pose]
    bones = Rig.load(snakemake.input.rig).surfaces
    bodies = {n: b.on_bones(bones) for n, b in read_bodies(snakemake.input.neutral).items()}
    transforms = read_registration(snakemake.input.registration, bones)
    posed = {n: b.posed(shapes[n]["vertices"], transforms) for n, b in bodies.items()}
    found = separate_posed(posed, each_moved(bones, transforms))
    log.info("penetration %.3f mm before, %.3f mm after", found.penetration_before, found.penetration)
    found.save(snakemake.output[0], [*snakemake.input])
