"""A scene as a movie: the skin and the organs inside it, seen from the palm."""

from common import dataset_of, inputs_of, output_of, stage

with stage(snakemake):
    from handpipe.stages.views.render_movie import Inputs, render_movie

    render_movie(inputs_of(snakemake, Inputs), output_of(snakemake), dataset_of(snakemake))
