"""What a person would bring to a subject that is made from a coupled body."""

from common import stage

with stage(snakemake):
    from handpipe.config import load_dataset
    from handpipe.datasets import coupled_hand

    given = snakemake.input
    hand = coupled_hand.hand_body(given.template, given.subject, snakemake.params.order)
    coupled_hand.write_templates(load_dataset(given.dataset), hand, coupled_hand.load(given.positions))
