"""The neutral skin from its scan, with nails and the cut end: for the fat and the soft tissue."""

from common import dataset_of, stage

with stage(snakemake) as log:
    import numpy as np

    from handpipe.fat.constraints import cut_end
    from handpipe.fat.nails import nail_vertices
    from handpipe.fat.skin import Rigid, Skin, closed_skin
    from handpipe.mesh.scan import read_scan
    from handpipe.mesh.surface import read_surface

    dataset = dataset_of(snakemake)
    scan = read_scan(snakemake.input.scan)
    skin, notes = closed_skin(scan, snakemake.params.edge)
    for note in notes:
        log.info("neutral scan: %s", note)
    parts = {
        name: Rigid(nail.bone, nail_vertices(skin, read_surface(dataset.path(nail.surface)), tolerance=0.4))
        for name, nail in dataset.nails.items()
    }
    parts["cut_end"] = Rigid(dataset.root_bone, np.flatnonzero(cut_end(skin, scan, tolerance=1.0)))
    rigid = {name: part for name, part in parts.items() if len(part.vertices)}
    log.info("%d vertices, rigid parts: %s", len(skin.vertices), ", ".join(rigid))
    Skin(skin, rigid).save(snakemake.output[0], [snakemake.input.scan])
