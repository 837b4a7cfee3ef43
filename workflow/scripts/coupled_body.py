"""A template hand as one body of all tissues, whose joints can open."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe.datasets import coupled_hand
    from handpipe.datasets.known_hands import known_hand
    from handpipe.truth import anatomy_file

    files = [snakemake.input.template, snakemake.input.subject]
    motion = known_hand(dataset_of(snakemake)).motion
    anatomy = coupled_hand.opened_hand(*files, motion)
    log.info("%d tets, %d vertices", len(anatomy.mesh.tets), len(anatomy.mesh.vertices))
    anatomy_file.save(snakemake.output[0], anatomy, files)
