"""Equilibrium of a generated subject's coupled body in one pose."""

from common import stage

with stage(snakemake) as log:
    from handpipe.datasets import coupled_hand

    files = [snakemake.input.body, snakemake.input.subject]
    hand = coupled_hand.hand_body(*files, snakemake.params.order)
    log.info("%d tets, %d nodes", len(hand.body.anatomy.mesh.tets), len(hand.body.rest))
    coupled_hand.save(snakemake.output[0], coupled_hand.settle(hand, snakemake.wildcards.pose), files)
