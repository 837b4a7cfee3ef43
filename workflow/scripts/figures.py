"""What a stage cost, from the benchmark files of its rules' jobs."""

import csv
from pathlib import Path


def stage_cost(job, *rules):
    """`seconds` (sum over jobs) and `peak_memory` (largest job) of a subject's rules, as metrics."""
    folder = Path("results") / job.wildcards.subject / "benchmarks"
    seconds, memory = 0.0, 0.0
    for rule in rules:
        for path in (folder / rule).rglob("*.tsv"):
            with open(path) as file:
                row = next(csv.DictReader(file, delimiter="\t"))
            seconds += float(row["s"])
            memory = max(memory, float(row["max_rss"]) if row["max_rss"] not in ("-", "NA") else 0.0)
    return {"seconds": (seconds, "s"), "peak_memory": (memory / 1024, "GiB")}
