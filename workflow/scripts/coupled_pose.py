"""Equilibrium of a generated subject's coupled body in one pose."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe.datasets import coupled_hand
    from handpipe.datasets.known_hands import known_hand

    files = [snakemake.input.body, snakemake.input.subject]
    hand = coupled_hand.hand_body(*files, snakemake.params.order)
    log.info("%d tets, %d nodes", len(hand.body.anatomy.mesh.tets), len(hand.body.rest))
    motion = known_hand(dataset_of(snakemake)).motion
    found = coupled_hand.settle(hand, motion, snakemake.wildcards.pose)
    coupled_hand.save(snakemake.output[0], found, files)
