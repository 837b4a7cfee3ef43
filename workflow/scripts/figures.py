"""What a stage cost, from the benchmark files of its rules' jobs."""

from handpipe.evaluation.build import read_jobs


def stage_cost(job, *rules):
    """`seconds` (sum over jobs) and `peak_memory` (largest job) of a subject's rules, as metrics."""
    jobs = [j for j in read_jobs(f"results/{job.wildcards.subject}/benchmarks") if j.rule in rules]
    return {
        "seconds": (sum(j.seconds for j in jobs), "s"),
        "peak_memory": (max((j.peak_memory for j in jobs), default=0.0), "GiB"),
    }
