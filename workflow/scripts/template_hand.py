"""The template hand of a generated subject: muscles, ligaments, tendons and nails from the curves' file."""

from common import stage

with stage(snakemake) as log:
    from handpipe import metrics
    from handpipe.anatomy.hand import build_hand, load_hand
    from handpipe.datasets.template_hand import bare_hand
    from handpipe.fem.linear import factorise

    file = load_hand(snakemake.input.curves)
    edges, figures = snakemake.params.edges, {}
    with metrics.measured(figures):
        bare = bare_hand(edges["bone"], edges["skin"])
        hand = build_hand(file, bare, edges["fat"], factorise=factorise, source=snakemake.input.curves)
    hand.tissue.save(snakemake.output.tissue, [snakemake.input.curves])
    hand.subject.save(snakemake.output.subject, [snakemake.input.curves])
    metrics.write(snakemake.output.metrics, hand.metrics() | figures)
    log.info("%d tets, %d tissues", len(hand.tissue.labels), len(hand.tissue.names))
