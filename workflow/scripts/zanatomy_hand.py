"""The template hand of real anatomy, and a list of all that was repaired for it."""

import json

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe import artifacts, metrics
    from handpipe.datasets import zanatomy_hand
    from handpipe.datasets.source_meshes import folder_of
    from handpipe.fem.linear import factorise

    folder, figures = folder_of(dataset_of(snakemake)), {}
    with metrics.measured(figures):
        hand = zanatomy_hand.build(folder, snakemake.params.edges, factorise=factorise)
    hand.template.tissue.save(snakemake.output.tissue)
    hand.template.subject.save(snakemake.output.subject)
    artifacts.write_text(snakemake.output.repairs, json.dumps(hand.repairs, indent=2))
    metrics.write(snakemake.output.metrics, hand.template.metrics() | figures)
    for row in hand.repairs:
        log.info("%s: %s: %.4g %s", row["organ"], row["what"], row["value"], row["unit"])
