"""Figures that several stages have: what they cost, and how contact settled."""

from handpipe.evaluation.build import read_jobs


def stage_cost(job, *rules):
    """`seconds` (sum over jobs) and `peak_memory` (largest job) of a subject's rules, as metrics."""
    jobs = [j for j in read_jobs(f"results/{job.wildcards.subject}/benchmarks") if j.rule in rules]
    return {
        "seconds": (sum(j.seconds for j in jobs), "s"),
        "peak_memory": (max((j.peak_memory for j in jobs), default=0.0), "GiB"),
    }


def pose_cost(job, poses, *rules):
    """`seconds_per_pose`, mean, and `seconds_per_pose_max`: the jobs of a pose, one after the other."""
    jobs = [j for j in read_jobs(f"results/{job.wildcards.subject}/benchmarks") if j.rule in rules]
    seconds = [sum(j.seconds for j in jobs if j.name.split("/")[0] == pose) for pose in poses]
    return {
        "seconds_per_pose": (sum(seconds) / len(seconds), "s"),
        "seconds_per_pose_max": (max(seconds), "s"),
    }


def contact_figures(settled, prefix=""):
    """Most renewals of contact planes, largest motion that was left, and how many frames did not settle.

    settled: what the layer says of itself in each frame (`handpipe.settling.Settled.figures`).
    """
    return {
        f"{prefix}contact_renewals_max": (max(f["contact_renewals"] for f in settled), "1"),
        f"{prefix}contact_motion_max": (max(f["contact_motion"] for f in settled), "mm"),
        f"{prefix}contact_unsettled": (sum(f["contact_unsettled"] for f in settled), "1"),
    }
