"""Wall-clock time and peak memory of the whole build."""

from common import stage

with stage(snakemake):
    from handpipe import metrics
    from handpipe.evaluation.build import build_metrics, read_jobs

    jobs = read_jobs(f"results/{snakemake.wildcards.subject}/benchmarks")
    metrics.write(snakemake.output[0], build_metrics(jobs))
