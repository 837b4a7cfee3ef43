"""Simulated tendons against truth, in example and held-out poses."""

from common import dataset_of, stage
from figures import stage_cost

with stage(snakemake):
    import numpy as np

    from handpipe import metrics
    from handpipe.config import Role
    from handpipe.skeleton.rig import Rig
    from handpipe.tendons.registration import centreline_errors
    from handpipe.tendons.rod import length_change
    from handpipe.tendons.tendon import Tendon
    from layers import flesh_in_poses
    from truth import true_pose

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    figures = stage_cost(snakemake, "simulate_flesh", "extract_tendon", "register_tendon", "fit_hooks")
    errors, changes = {Role.example: [], Role.heldout: []}, []
    poses = [*dataset.examples, *dataset.heldout]
    flesh = {pose: shape.vertices for pose, shape in flesh_in_poses(snakemake.input.flesh).items()}
    for path in snakemake.input.tendons:
        tendon = Tendon.load(path)
        for pose in poses:
            x = tendon.solve(rig.scanned_bones(pose), flesh.get(pose)).x
            changes.append(100 * length_change(x, tendon.rest.length))
            if dataset.truth is None:
                continue
            true = true_pose(dataset, pose)["tendons"][tendon.name]
            line = rig.poses[pose].root.inverse()(true["centreline"])
            errors[dataset.poses[pose].role].append(np.concatenate(centreline_errors(x, line)))
    figures["length_change_max"] = (float(np.max(changes)), "%")
    if errors[Role.example]:
        figures |= metrics.summary("centreline_error", np.concatenate(errors[Role.example]), "mm")
    if errors[Role.heldout]:
        figures |= metrics.summary("heldout_centreline_error", np.concatenate(errors[Role.heldout]), "mm")
    metrics.write(snakemake.output[0], figures)
