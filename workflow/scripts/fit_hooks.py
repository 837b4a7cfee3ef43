"""Hooks of a tendon: skinning weights and pose-space corrections from registered rods (Zheng 2022 §5.4)."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe import artifacts
    from handpipe.mesh.rigid import RigidTransform
    from handpipe.skeleton.rig import Rig
    from handpipe.tendons.rest import RestTendon
    from handpipe.tendons.tendon import RegisteredRods, build_tendon
    from layers import flesh_in_poses

    dataset = dataset_of(snakemake)
    name = snakemake.wildcards.tendon
    rig = Rig.load(snakemake.input.rig)
    neutral = artifacts.read(snakemake.input.neutral, "neutral_tendon")
    bones = {b: rig.surfaces[b] for b in dataset.tendons[name].bones}
    rest = RestTendon.build(neutral["x"], neutral["radii"], bones)
    # The hooks are driven by the rig, as in the simulation; rods come from the scanner's frame to the rig's.
    rods = {dataset.neutral: rest.x}
    poses = {dataset.neutral: dict.fromkeys(bones, RigidTransform.identity())}
    for pose, path in zip(dataset.examples, snakemake.input.poses, strict=True):
        rods[pose] = rig.poses[pose].root.inverse()(artifacts.read(path, "posed_tendon")["x"])
        moved = rig.scanned_bones(pose)
        poses[pose] = {b: moved[b] for b in bones}
    flesh = flesh_in_poses(snakemake.input.flesh)
    radius = float(neutral["radii"].mean())
    examples = RegisteredRods(rods, poses, rig.parents, flesh or None)
    tendon = build_tendon(name, rest, radius, bones, examples)
    tendon.save(snakemake.output[0], [*snakemake.input])
