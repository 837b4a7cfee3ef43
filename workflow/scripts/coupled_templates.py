"""What a person would bring to a subject that is made from a coupled body."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.anatomy.template import Template
    from handpipe.datasets import coupled_hand
    from handpipe.datasets.marked_ends import marked_ends

    given = snakemake.input
    hand = coupled_hand.hand_body(given.body, given.subject, snakemake.params.order)
    marked = marked_ends(Template.load(given.template), hand.subject)
    neutral = coupled_hand.load(given.positions)
    coupled_hand.write_templates(dataset_of(snakemake), hand, neutral, marked)
