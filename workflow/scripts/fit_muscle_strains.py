"""Plastic strains of a muscle, smooth in space and over poses (Zheng 2022 §4.4, stage 3, Eq. 3)."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe import artifacts
    from handpipe.mesh.surface import each_moved
    from handpipe.muscles.muscle import Examples, Muscle, SeparatedShape
    from handpipe.muscles.separation import load_surfaces
    from handpipe.skeleton.rig import Rig
    from layers import flesh_in_poses
    from muscle_files import read_bodies

    dataset = dataset_of(snakemake)
    name = snakemake.wildcards.muscle
    rig = Rig.load(snakemake.input.rig)
    body = read_bodies(snakemake.input.neutral)[name]
    shapes = artifacts.read(snakemake.input.shapes, "muscle_shapes")
    # Surfaces come from each scanner's frame to the rig's, in which the muscle will be simulated.
    back = {pose: rig.poses[pose].root.inverse() for pose in dataset.examples}
    transforms = {pose: rig.scanned_bones(pose) for pose in dataset.examples}
    separated_shapes = {}
    for pose, path in zip(dataset.examples, snakemake.input.separated, strict=True):
        separated = {n: s.moved(back[pose](s.vertices)) for n, s in load_surfaces(path).items()}
        own = separated.pop(name)
        start = back[pose](shapes[pose][name]["mesh_vertices"])
        known = {bone: s for bone, s in rig.surfaces.items() if bone in transforms[pose]}
        bones = each_moved(known, transforms[pose])
        separated_shapes[pose] = SeparatedShape(own, start, [*separated.values(), *bones.values()])
    flesh = flesh_in_poses(snakemake.input.flesh)
    examples = Examples(rig.parents, dataset.neutral, transforms, dataset.muscle_interpolation, flesh)
    muscle, fit = Muscle.fit(name, body, examples, separated_shapes)
    log.info(
        "gamma %.3g, eigenvalues %.2f to %.2f, %.3f mm", fit.gamma, *fit.eigenvalues, fit.distances.max()
    )
    muscle.save(snakemake.output[0], [*snakemake.input])
