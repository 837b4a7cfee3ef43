"""One HTML file with pictures, tables, figures and costs of a subject."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.evaluation import (
    PoseView,
    ReportInput,
    bone_warnings,
    frame_warnings,
    pose_warnings,
    read_jobs,
    read_warnings,
    write_report,
)
from handpipe.hand import StoredFrames, read_frames
from handpipe.imaging.volumes import pose_volume
from handpipe.mesh.files import read_scan
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.truth import surfaces_in, true_pose

UNKNOWN = "unknown"  # commit of code outside of a repository


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    metrics: Sequence[Path]
    tables: Sequence[Path]
    poses: Sequence[Path]
    volumes: Sequence[Path]
    scans: Sequence[Path]
    truth: Sequence[Path]
    chunks: Sequence[Path]
    exports: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    page: Path
    pictures: Path


@dataclass(frozen=True)
class JobFiles:
    """Folders of what Snakemake measured of the subject's jobs, and of what they logged."""

    costs: Path
    logs: Path


def report(
    inputs: Inputs,
    outputs: Outputs,
    dataset: Dataset,
    scenes: Mapping[str, Sequence[Path]],
    settings: Mapping[str, str],
    jobs: JobFiles,
    benchmarks: Path,
) -> None:
    """One HTML file with pictures, tables, figures and costs of a subject; the pictures as files, too."""
    rig = Rig.load(inputs.rig)

    given = {name: dataset.path(pose.scan) for name, pose in dataset.poses.items() if pose.scan is not None}
    # Skins of volumes and aligned scans lie in a folder of their pose.
    scans = {path.parent.name: path for path in inputs.scans}
    scans |= {name: path for name, path in given.items() if path in inputs.scans}
    bare = [name for name in dataset.poses if name in scans and dataset.poses[name].scan is None]

    def truth_of(pose: str) -> dict[str, list[Surface]]:
        """True surfaces by tissue, where the subject has a truth."""
        if dataset.truth is None:
            return {}
        data = true_pose(inputs.truth, pose)
        found = {kind: data.get(kind, {}) for kind in ("bones", "muscles", "ligaments")}
        found["skin"] = {"skin": data["skin"]}
        return {kind: [*surfaces_in(group).values()] for kind, group in found.items()}

    def view(pose: str) -> PoseView:
        files = {p.stem.split("-")[0]: p for p in inputs.poses if p.parent.name == pose}
        [(frame, layers)] = read_frames(files["inner"])
        if "skin" in files:
            [(_, skins)] = read_frames(files["skin"])
            layers |= {"fat": skins["m0"]}
        data = dataset.poses[pose]
        return PoseView.from_scanner(
            frame,
            layers,
            data.role.value,
            rig.poses[pose].root,
            sample=pose_volume(dataset, pose).sample,
            scan=read_scan(scans[pose]) if pose in scans else None,
            truth=truth_of(pose),
        )

    asked = {p.stem: metrics.read(p) for p in inputs.metrics}

    tables = {p.stem: json.loads(p.read_text(encoding="utf-8")) for p in inputs.tables}

    simulated = {p.parent.name for p in inputs.poses}
    shown = [pose for pose in dataset.poses if pose in simulated]
    frames = {name: StoredFrames(paths) for name, paths in scenes.items()}
    warnings = bone_warnings(asked.get("segmentation", {}))
    warnings += pose_warnings(tables.get("poses", []))
    warnings += [said for name in scenes for said in frame_warnings(name, tables[f"frames-{name}"])]
    if "template_turn" in (rig_figures := asked.get("rig", {})):
        error, turned, turn = (
            rig_figures[name][0] for name in ("template_error", "template_error_turned", "template_turn")
        )
        warnings.append(
            f"The template hand's bones fit nearly as well turned by {turn:.0f} deg ({turned:.2f} mm; "
            f"{error:.2f} mm as they are): look whether muscles, tendons and nails lie on the right side."
        )
    if bare:
        warnings.append(f"Skin without a scan, from the volume: {', '.join(bare)}. Nails are not in it.")
    write_report(
        outputs.page,
        ReportInput(
            dataset,
            rig=rig,
            poses=[view(pose) for pose in shown],
            skin_rows=tables.get("skin", []),
            muscle_rows=tables.get("muscles", []),
            rig_rows=tables.get("rig", []),
            metrics=asked,
            scenes=frames,
            warnings=warnings,
            jobs=read_jobs(jobs.costs),
            job_warnings=read_warnings(jobs.logs),
            benchmarks=metrics.read(benchmarks) if benchmarks.exists() else {},
            settings=settings,
            made=_made(inputs),
            inputs={_name(path, dataset): artifacts.content_hash(path) for path in _given(inputs)},
            limits=["The limits of this version stand in docs/limitations.md."],
        ),
        outputs.pictures,
    )


def _given(inputs: Inputs) -> list[Path]:
    """Images and scans, each once."""
    return list(dict.fromkeys([*inputs.volumes, *inputs.scans]))


def _name(path: Path, dataset: Dataset) -> str:
    """A file as the dataset names it, or else as the workflow does."""
    return str(path.relative_to(dataset.root) if path.is_relative_to(dataset.root) else path)


def _made(inputs: Inputs) -> dict[str, str]:
    """When the report was made, by which code, and by which code the artifacts that it shows."""
    commits = [
        str(artifacts.read_attributes(path).get("commit", "")) or UNKNOWN
        for path in (inputs.rig, *inputs.poses, *inputs.chunks)
    ]
    counts = Counter(commits)
    return {
        "made on": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "commit": artifacts.commit() or UNKNOWN,
        "artifacts by commit": ", ".join(f"{c} ({n} files)" for c, n in counts.most_common()),
    }
