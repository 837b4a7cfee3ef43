"""Seeds of a pose from the neutral bones and the pose's image, and how sure each bone's place is."""

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.images.propose_seeds import Inputs, Outputs, propose_seeds

    propose_seeds(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        snakemake.wildcards.pose,
        snakemake.params.labelled,
    )
