"""One HTML file with pictures, tables, figures and costs of a subject."""

from pathlib import Path

from common import dataset_of, inputs_of, outputs_of, stage

with stage(snakemake):
    from handpipe.stages.hand.report import Inputs, JobFiles, Outputs, report

    report(
        inputs_of(snakemake, Inputs),
        outputs_of(snakemake, Outputs),
        dataset_of(snakemake),
        {scene: [Path(path) for path in paths] for scene, paths in snakemake.params.scenes.items()},
        snakemake.params.settings,
        JobFiles(Path(snakemake.params.jobs), Path(snakemake.params.logs)),
        Path(snakemake.params.benchmarks),
    )
