"""The cloth around the muscles, and how each of its vertices is held."""

from common import stage

with stage(snakemake) as log:
    import numpy as np

    from handpipe.fascia.fascia import ClothSettings, Fascia
    from handpipe.fascia.regions import muscle_regions, read_regions
    from handpipe.fascia.wrapping import wrap
    from handpipe.muscles.muscle import Muscle

    muscles = [Muscle.load(path) for path in snakemake.input.muscles]
    surfaces = {m.name: m.body.surface for m in muscles}
    surface = wrap(list(surfaces.values()), snakemake.params.edge)
    attached = np.concatenate([m.body.surface.vertices[m.body.held] for m in muscles])
    regions = muscle_regions(surface.vertices, surfaces, attached, attached_radius=2.0, gap=0.8)
    if painted := snakemake.input.get("regions"):
        regions = read_regions(painted, len(surface.vertices))
    log.info("%d vertices; contact, sliding, fixed: %s", len(regions), np.bincount(regions, minlength=3))
    cloth = ClothSettings(shrink=0.40)
    Fascia.around("muscle_fascia", surface, regions, surfaces, cloth).save(
        snakemake.output[0], [*snakemake.input]
    )
