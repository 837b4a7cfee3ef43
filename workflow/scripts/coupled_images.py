"""Volume, scan, truth and label volumes of one pose of a coupled body."""

from common import stage

with stage(snakemake):
    from handpipe.config import load_dataset
    from handpipe.datasets import coupled_hand

    given = snakemake.input
    hand = coupled_hand.hand_body(given.body, given.subject, snakemake.params.order)
    found = coupled_hand.load(given.positions)
    coupled_hand.write_pose(load_dataset(given.dataset), snakemake.wildcards.pose, hand, found)
