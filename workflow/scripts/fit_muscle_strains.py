"""Plastic strains of a muscle, smooth in space and over poses (000 section 4.4, stage 3, Eq. 3)."""

from common import stage

with stage(snakemake) as log:
    import numpy as np

    from handpipe import artifacts
    from handpipe.config import load_dataset
    from handpipe.muscles.muscle import Muscle
    from handpipe.muscles.pose_strains import fit_pose_strains
    from handpipe.skeleton.pose_space import pose_vector, reference_bone
    from handpipe.skeleton.rig import Rig
    from muscle_files import read_bodies, read_surfaces

    dataset = load_dataset(snakemake.input.dataset)
    name = snakemake.wildcards.muscle
    rig = Rig.load(snakemake.input.rig)
    body = read_bodies(snakemake.input.neutral)[name]
    shapes = artifacts.read(snakemake.input.shapes, "muscle_shapes")
    # Surfaces come from each scanner's frame to the rig's, in which the muscle will be simulated.
    back = {pose: rig.poses[pose].root.inverse() for pose in dataset.examples}
    surfaces = [
        back[pose](read_surfaces(path)[0][name].vertices)
        for pose, path in zip(dataset.examples, snakemake.input.separated, strict=True)
    ]
    starts = [back[pose](shapes[pose][name]["mesh_vertices"]) for pose in dataset.examples]
    transforms = {pose: rig.bone_transforms(rig.poses[pose].angles) for pose in dataset.examples}
    bones = list(body.attachments)
    reference = reference_bone(bones, rig.parents)
    vectors = np.stack([pose_vector(bones, reference, transforms[pose]) for pose in dataset.examples])
    fit = fit_pose_strains(body.mesh, body.matrix, surfaces, vectors, starts, body.held)
    log.info(
        "gamma %.3g, eigenvalues %.2f to %.2f, %.3f mm", fit.gamma, *fit.eigenvalues, fit.distances.max()
    )
    muscle = Muscle.of(name, body, rig.parents, dataset.neutral, transforms, fit)
    muscle.save(snakemake.output[0], [*snakemake.input])
