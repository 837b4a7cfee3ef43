"""What solvers say of the scanned poses: of the simulated layers, and of the fits to scans."""

from common import inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.hand.evaluate_poses import Inputs, Outputs, evaluate_poses

    evaluate_poses(inputs_of(snakemake, Inputs), outputs_of(snakemake, Outputs))
