"""Shapes of all muscles in the example poses (Zheng 2022 §4.4, stage 1)."""

from common import dataset_of, stage

with stage(snakemake):
    from dataclasses import replace
    from functools import partial

    from handpipe import artifacts
    from handpipe.imaging.markers import read_landmarks, read_markers
    from handpipe.imaging.volume import pose_volume
    from handpipe.muscles.extraction import PoseData, extract_poses
    from handpipe.skeleton.bones import read_registration
    from handpipe.skeleton.rig import Rig
    from layers import flesh_in_poses
    from muscle_files import read_bodies

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    bones = rig.surfaces
    transforms = {
        pose: read_registration(path, bones)
        for pose, path in zip(dataset.examples, snakemake.input.registrations, strict=True)
    }
    flesh = {
        pose: replace(shape, vertices=rig.poses[pose].root(shape.vertices))
        for pose, shape in flesh_in_poses(snakemake.input.flesh).items()
    }
    poses = {
        pose: PoseData(
            moved,
            partial(pose_volume, dataset, pose),
            {m: read_markers(dataset.path(path))[0] for m, path in dataset.poses[pose].markers.items()},
            {m: read_landmarks(dataset.path(path)) for m, path in dataset.poses[pose].landmarks.items()},
            flesh.get(pose),
        )
        for pose, moved in transforms.items()
    }
    found = extract_poses(read_bodies(snakemake.input.neutral), bones, poses)
    data = {
        pose: {m: {"vertices": e.surface.vertices, "mesh_vertices": e.vertices} for m, e in muscles.items()}
        for pose, muscles in found.items()
    }
    units = {f"{p}/{m}/{k}": "mm" for p, ms in data.items() for m, ks in ms.items() for k in ks}
    artifacts.write(snakemake.output[0], data, kind="muscle_shapes", units=units, inputs=[*snakemake.input])
