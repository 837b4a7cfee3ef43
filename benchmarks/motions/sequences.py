"""Figures of simulated sequences, from the tables and logs that their build left."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import InputError, Metrics, read_text
from handpipe.core import metrics as metrics_files
from handpipe.develop.tables import layer_seconds

REMEDY = "Build its frames first"


@dataclass(frozen=True)
class Published:
    """A sequence of Zheng 2022 Table 3: its title, and its hours on 56 cores."""

    title: str
    hours: float


PUBLISHED = {  # by the scene that stands for it here
    "close-fist": Published("Close the fist", 14.1),
    "thumb-opposition": Published("Opposition of the thumb", 44.8),
    "performance": Published("Performance animation", 46.7),
    "numbers": Published("Numbers 1-5", 42.8),
    "sign-letters": Published("American Sign Language", 63.8),
}
SUMS = {  # figures of frames that are added up, by the end of their names in the table: name and unit
    "inverted_tets": ("inverted_tets", "tets"),
    "skin_crossings": ("penetrations", "1"),
    "contact_unsettled": ("unsettled_frames", "frames"),
}
DEEPEST = "body_penetration"  # mm, of which the largest counts
OF_SCENE = ("continuity_max", "pop_max", "pops", "unexplained_max")


def of_scene(folder: Path, scene: str) -> Metrics:
    """Figures of a scene's frames in a subject's folder.

    Raises
    ------
    InputError
        Where they have not been built.
    """
    table = folder / f"tables/frames-{scene}.json"
    if not table.is_file():
        raise InputError(table, scene, "has not been simulated", REMEDY)
    rows = json.loads(read_text(table))
    finished = [row for row in rows if "failed" not in row]
    found: Metrics = {
        "frames": (float(len(rows)), "frames"),
        "failed_frames": (float(len(rows) - len(finished)), "frames"),
        "body_penetration_max": (max((_worst(row, DEEPEST) for row in finished), default=0.0), "mm"),
    }
    for ending, (name, unit) in SUMS.items():
        found[name] = (sum(_worst(row, ending) for row in finished), unit)
    known = metrics_files.read(folder / f"metrics/frames-{scene}.json")
    found |= {name: known[name] for name in OF_SCENE if name in known}
    return found | _seconds(layer_seconds(folder / "logs/simulate" / scene))


def _worst(row: Mapping[str, object], ending: str) -> float:
    """The largest figure of a frame whose name ends so; zero without one."""
    return max((float(str(value)) for name, value in row.items() if name.endswith(ending)), default=0.0)


def _seconds(frames: Mapping[str, Mapping[str, float]]) -> Metrics:
    """Wall seconds of a frame in one job, and each layer's share of all, from those by frame and layer."""
    totals = [sum(layers.values()) for layers in frames.values()]
    if not totals:
        return {}
    found: Metrics = {
        "seconds_mean": (float(np.mean(totals)), "s"),
        "seconds_median": (float(np.median(totals)), "s"),
        "seconds_max": (max(totals), "s"),
        "hours": (sum(totals) / 3600, "h"),
    }
    for layer in dict.fromkeys(layer for layers in frames.values() for layer in layers):
        spent = sum(layers.get(layer, 0.0) for layers in frames.values())
        found[f"{layer}_share"] = (100 * spent / sum(totals), "%")
    return found


def together(scenes: Sequence[Metrics]) -> Metrics:
    """Figures of several scenes: sums of counts and hours, and the largest of the others."""
    counts = ("frames", "failed_frames", "pops", "hours", *(name for name, _ in SUMS.values()))
    largest = ("continuity_max", "pop_max", "unexplained_max", "body_penetration_max", "seconds_max")
    found: Metrics = {}
    for names, total in ((counts, sum), (largest, max)):
        for name in names:
            values = [scene[name] for scene in scenes if name in scene]
            if values:
                found[name] = (float(total([value for value, _ in values])), values[0][1])
    found["sequence_frames"] = found.pop("frames")
    return found
