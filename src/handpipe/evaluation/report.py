"""The report: one HTML file with everything in it, pictures, tables and a 3D view."""

from __future__ import annotations

import base64
import logging
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from handpipe import __version__
from handpipe.core import Frame, Metrics, RigidTransform, Shapes, write_text
from handpipe.core.configuration import Dataset
from handpipe.evaluation import pictures
from handpipe.evaluation.benchmarks import Figures, benchmark_table, error_figures
from handpipe.evaluation.build import Job, cost_table
from handpipe.evaluation.moved_images import anatomical_planes
from handpipe.evaluation.rendering import Camera
from handpipe.evaluation.sides import AXES
from handpipe.evaluation.slices import Plane, Sample
from handpipe.evaluation.surfaces import surface_distance
from handpipe.evaluation.table import Row, Table, metrics_table, muscle_table, rig_table, skin_table
from handpipe.evaluation.viewer import page_scripts, view_data
from handpipe.hand import SimulatedFrame, frame_angles, shown, tissue
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import HandDirections, Rig, hand_directions

log = logging.getLogger(__name__)

SIZE = (520, 390)  # pixels of a picture
UNTOLD = (
    "No joint of this subject tells its anatomical directions, as a flexion does: pictures are drawn "
    "along the axes of the neutral image, x for distal, y for radial, z for dorsal, and slices are left out."
)


@dataclass
class PoseView:
    """One pose: what was simulated, and what it is compared with, all in the frame of the root bone at rest.

    A pose's images have a frame of their own: see `from_scanner`.

    Parameters
    ----------
    frame : Frame
        The pose.
    layers : mapping of str to Shapes
        Simulated shapes by layer and body.
    role : str
        Role of the pose in the fit.
    sample : callable, optional
        Grey values (n,) of the volume at points (n, 3) in mm, NaN outside of it.
    scan : Surface, optional
        Scanned skin in mm.
    truth : mapping of str to sequence of Surface
        True surfaces in mm by tissue ("skin", "muscles", ...).
    """

    frame: Frame
    layers: Mapping[str, Shapes]
    role: str
    sample: Sample | None = None
    scan: Surface | None = None
    truth: Mapping[str, Sequence[Surface]] = field(default_factory=dict)

    @staticmethod
    def from_scanner(
        frame: Frame,
        layers: Mapping[str, Shapes],
        role: str,
        root: RigidTransform,
        sample: Sample | None = None,
        scan: Surface | None = None,
        truth: Mapping[str, Sequence[Surface]] | None = None,
    ) -> PoseView:
        """A pose with volume, scan and truth in the scanner's frame.

        Parameters
        ----------
        frame, layers, role
            As in `PoseView`, in the frame of the root bone at rest.
        root : RigidTransform
            The root bone's registered transform, which carries the simulation's frame into the scanner's.
        sample, scan, truth
            As in `PoseView`, in the scanner's frame.

        Returns
        -------
        PoseView
            All of the pose in the frame of the root bone at rest.
        """
        back = root.inverse()
        return PoseView(
            frame,
            layers,
            role,
            None if sample is None else lambda points: sample(root(points)),
            None if scan is None else scan.moved(back(scan.vertices)),
            {name: [s.moved(back(s.vertices)) for s in found] for name, found in (truth or {}).items()},
        )


@dataclass
class ReportInput:
    """All that a report shows; it leaves out what is empty.

    Parameters
    ----------
    dataset : Dataset
        The subject.
    rig : Rig, optional
        Joints and neutral bones: they tell distal, dorsal and radial, and where slices lie.
    poses : sequence of PoseView
        Scanned poses with pictures.
    skin_rows : sequence of Row
        Errors of skin, of `table.skin_rows`.
    muscle_rows : sequence of Row
        Errors of muscles, of `muscles.error_rows`.
    rig_rows : sequence of Row
        Errors of joints, of `skeleton.rig.joint_table`.
    metrics : mapping of str to Metrics
        Figures by stage, in the order shown.
    scenes : mapping of str to sequence of SimulatedFrame
        Frames of the 3D view by scene, besides the poses.
    jobs : sequence of Job
        Jobs of the build.
    benchmarks : Figures
        Figures of `snakemake benchmark_fem`.
    settings : mapping of str to str
        What a person chose, by name.
    made : mapping of str to str
        When and by what the report was made, by name.
    inputs : mapping of str to str
        Hash of each image and scan, by its name.
    limits : sequence of str
        Sentences on the limits of the method.
    warnings : sequence of str
        Sentences that the report shows first.
    job_warnings : mapping of str to sequence of str
        What jobs warned of, by rule.
    """

    dataset: Dataset
    rig: Rig | None = None
    poses: Sequence[PoseView] = ()
    skin_rows: Sequence[Row] = ()
    muscle_rows: Sequence[Row] = ()
    rig_rows: Sequence[Row] = ()
    metrics: Mapping[str, Metrics] = field(default_factory=dict)
    scenes: Mapping[str, Sequence[SimulatedFrame]] = field(default_factory=dict)
    jobs: Sequence[Job] = ()
    benchmarks: Figures = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    made: Mapping[str, str] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    limits: Sequence[str] = ()
    warnings: Sequence[str] = ()
    job_warnings: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def directions(self) -> HandDirections | None:
        """Anatomical directions in neutral, None where nothing tells them."""
        return None if self.rig is None else hand_directions(self.rig, self.dataset.hand)


@dataclass(frozen=True)
class Picture:
    """A picture with the text that stands for it, the caption below it, and what it shows in a word."""

    png: bytes
    alt: str
    caption: str
    shows: str
    wide: bool = False

    @property
    def uri(self) -> str:
        """The picture inside an address."""
        return "data:image/png;base64," + base64.b64encode(self.png).decode("ascii")


def write_report(path: str | Path, report: ReportInput, folder: str | Path | None = None) -> None:
    """Write the report as one HTML file without links to anything outside of it.

    Parameters
    ----------
    path : path
        File to be written.
    report : ReportInput
        What it shows.
    folder : path, optional
        Folder of PNG files: its pictures of the scanned poses, "{pose}-{what it shows}.png", and two of each
        scene's frame that bends most, "{scene}-skin.png" and "{scene}-organs.png".
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("handpipe.evaluation", "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # the views keep their order
    made = _pictures(report)
    write_text(path, environment.get_template("report.html.jinja").render(_content(report, made)))
    if folder is not None:
        _write_pictures(Path(folder), {pose.frame.name: drawn for pose, drawn in made})
        _write_pictures(Path(folder), _scene_pictures(report))


def _write_pictures(folder: Path, made: Mapping[str, Sequence[Picture]]) -> None:
    """Write pictures by the name of what they are of."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, drawn in made.items():
        for picture in drawn:
            (folder / f"{name}-{picture.shows}.png").write_bytes(picture.png)


def _scene_pictures(report: ReportInput) -> dict[str, list[Picture]]:
    """Pictures of the frame of each scene that bends most."""
    made = {}
    for name, frames in report.scenes.items():
        bends = [sum(map(abs, angles.values())) for angles in frame_angles(frames)]
        for i in sorted(range(len(bends)), key=lambda number: -bends[number]):
            frame, layers = frames[i]
            if not any(shown(layers)):
                continue
            bent = PoseView(frame, layers, "frame")
            camera = _camera(bent, report.directions or AXES)
            made[name] = _body_pictures(bent, camera)
            break
    return made


def _content(report: ReportInput, made: Sequence[tuple[PoseView, list[Picture]]]) -> dict[str, Any]:
    found = skin_table(report.skin_rows), muscle_table(report.muscle_rows), rig_table(report.rig_rows)
    main_tables = [t for t in found if t]
    looks = {tissue(layer, body) for p in report.poses for layer, body, _ in shown(p.layers)}
    return {
        "subject": report.dataset.name,
        "facts": _facts(report.dataset),
        "versions": {
            "handpipe": __version__,
            "Python": platform.python_version(),
            **report.made,
            **report.settings,
        },
        "inputs": report.inputs,
        "poses": [(p.frame.name, p.role, _angles(p.frame), drawn) for p, drawn in made],
        "view": _view_text(report),
        "legend": pictures.legend(sorted(looks)),
        "tables": [table.html() for table in main_tables],
        "stages": [
            (stage, metrics_table(f"Stage {stage}.", metrics, list(report.dataset.poses)).html())
            for stage, metrics in report.metrics.items()
            if metrics
        ],
        "costs": [t.html() for t in (_stage_costs(report.metrics), cost_table(report.jobs)) if t],
        "benchmarks": benchmark_table(report.benchmarks),
        "curves": _curves(report.benchmarks),
        "scenes": [(name, data) for name, data in _scenes(report).items() if data["bodies"]],
        "scripts": page_scripts(),
        "limits": list(report.limits),
        "warnings": [*report.warnings, *([UNTOLD] if report.poses and report.directions is None else [])],
        "job_warnings": report.job_warnings,
    }


def _scenes(report: ReportInput) -> dict[str, Any]:
    """Data of the 3D view: the scanned poses, then the scenes."""
    poses = [(replace(p.frame, name=f"{p.frame.name} ({p.role})"), dict(p.layers)) for p in report.poses]
    scenes = {"scanned poses": poses} | dict(report.scenes)
    return {name: view_data(frames, report.directions) for name, frames in scenes.items() if frames}


def _view_text(report: ReportInput) -> str:
    if report.directions is None:
        return "Seen along the axes of the neutral image."
    side = report.dataset.hand  # of a right hand seen so, distal is to the right
    return f"Seen from the ulnar side and somewhat from above; distal is to the {side}, dorsal upwards."


def _curves(figures: Figures) -> list[Picture]:
    """Drawings of the solver's error over its time."""
    return [
        Picture(pictures.png(figure), f"Error over seconds by {study}", f"By {study}.", "curve")
        for study, figure in error_figures(figures).items()
    ]


def _facts(dataset: Dataset) -> dict[str, str]:
    by_role = {role: [n for n, p in dataset.poses.items() if str(p.role) == role] for role in _roles(dataset)}
    facts = {f"{role} poses": ", ".join(names) for role, names in by_role.items()}
    for kind in ("bones", "joints", "muscles", "ligaments", "tendons", "nails"):
        names = list(getattr(dataset, kind))
        if names:
            facts[kind] = f"{len(names)}: {', '.join(names)}"
    facts["hand"] = dataset.hand
    if dataset.generator:
        facts["images"] = f"generated by {dataset.generator}, seed {dataset.seed}"
    facts["truth"] = "known" if dataset.truth else "not known"
    return facts


def _roles(dataset: Dataset) -> list[str]:
    return list(dict.fromkeys(str(p.role) for p in dataset.poses.values()))


def _angles(frame: Frame) -> str:
    return ", ".join(
        f"{name.replace('_', ' ')} {round(np.degrees(a)):d}°" for name, a in frame.angles.items()
    )


def _stage_costs(metrics: Mapping[str, Metrics]) -> Table | None:
    rows = [
        [stage, *(found.get(key, (None, ""))[0] for key in ("seconds", "peak_memory"))]
        for stage, found in metrics.items()
        if "seconds" in found
    ]
    if not rows:
        return None
    return Table("Time and memory by stage.", ["stage", "time [s]", "peak memory [GiB]"], rows)


def _pictures(report: ReportInput) -> list[tuple[PoseView, list[Picture]]]:
    """Pictures of each pose; all poses are drawn at one scale."""
    poses = [pose for pose in report.poses if any(shown(pose.layers))]
    if not poses:
        return []
    cameras = [_camera(pose, report.directions or AXES) for pose in poses]
    height = max(camera.height for camera in cameras)
    largest = _largest_error(poses)
    made = []
    for pose, camera in zip(poses, cameras, strict=True):
        log.info("pictures of pose %s", pose.frame.name)
        camera = replace(camera, height=height)
        made.append((pose, _pose_pictures(pose, report, camera, largest)))
    return made


def _camera(pose: PoseView, neutral: HandDirections) -> Camera:
    """From the ulnar side and somewhat from above, of the hand as it is in the pose."""
    hand = neutral.moved(pose.frame.bones)
    sight = hand.radial - 0.25 * hand.distal - 0.35 * hand.dorsal
    return Camera.fit(pictures.extent(pose.layers), sight, hand.dorsal, SIZE)


def _body_pictures(pose: PoseView, camera: Camera) -> list[Picture]:
    """The skin, where there is one, and what is beneath it."""
    name, made = pose.frame.name, []
    if pictures.skin_surface(pose.layers) is not None:
        png = pictures.png(pictures.outer_picture(pose.layers, camera, SIZE))
        made.append(Picture(png, f"Simulated skin in pose {name}", "Simulated skin.", "skin"))
    png = pictures.png(pictures.inner_picture(pose.layers, camera, SIZE))
    alt, caption = f"Simulated organs in pose {name}", "Simulated organs; the skin is transparent."
    return [*made, Picture(png, alt, caption, "organs")]


def _pose_pictures(pose: PoseView, report: ReportInput, camera: Camera, largest: float) -> list[Picture]:
    name, skin = pose.frame.name, pictures.skin_surface(pose.layers)
    made = _body_pictures(pose, camera)
    if skin is not None and pose.scan is not None:
        png = pictures.png(pictures.error_picture(pose.scan, skin, camera, SIZE, largest))
        caption = f"Scanned skin: distance to the simulated skin, 0 (dark) to {largest:.2g} mm (yellow)."
        alt = f"Distance of scanned from simulated skin in pose {name}"
        made.append(Picture(png, alt, caption, "distance"))
    planes = _planes(pose, report)
    if planes:
        drawn = pictures.contours(pose.layers, pose.truth)
        png = pictures.png(pictures.slices_figure(pose.sample, planes, drawn))
        caption = "Simulated contours" + (" over the image" if pose.sample else "")
        caption += "; dotted: truth." if pose.truth else "."
        alt = f"Slices through pose {name} with contours of the tissues"
        made.append(Picture(png, alt, caption, "slices", wide=True))
    return made


def _largest_error(poses: Sequence[PoseView]) -> float:
    """Upper end in mm of the error colours: the 99th percentile over all poses."""
    found = [
        surface_distance(pose.scan.vertices, skin)
        for pose in poses
        if pose.scan is not None and (skin := pictures.skin_surface(pose.layers)) is not None
    ]
    return max(float(np.percentile(np.concatenate(found), 99)), 0.1) if found else 1.0


def _planes(pose: PoseView, report: ReportInput) -> dict[str, Plane]:
    if report.rig is None or report.directions is None or "bones" not in pose.layers:
        return {}
    return anatomical_planes(report.rig, pose.frame, pose.layers)
