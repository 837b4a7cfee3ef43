"""Volume, scan, truth and label volumes of one pose of a coupled body."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.datasets import coupled_hand

    given = snakemake.input
    hand = coupled_hand.hand_body(given.body, given.subject, snakemake.params.order)
    found = coupled_hand.load(given.positions)
    coupled_hand.write_pose(dataset_of(snakemake), snakemake.wildcards.pose, hand, found)
