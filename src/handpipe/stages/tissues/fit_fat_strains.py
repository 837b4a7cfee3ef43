"""Nail corrections and plastic strains of the fat in one example pose (Zheng 2022 §7.2 and 7.3)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts
from handpipe.core.configuration import Dataset
from handpipe.hand import figure_units, read_frames
from handpipe.mesh.files import read_scan
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.fat import FitSettings, Tissue, as_vector, fit_correction, fit_strains


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    mesh: Path
    inner: Path
    scan: Path


def fit_fat_strains(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """Nail corrections and plastic strains of the fat in one example pose (Zheng 2022 §7.2 and 7.3)."""
    rig = Rig.load(inputs.rig)
    tissue = Tissue.load(inputs.mesh)
    [(frame, below)] = read_frames(inputs.inner)
    scan = read_scan(inputs.scan)
    scan = scan.moved(rig.poses[frame.name].root.inverse()(scan.vertices))

    nails, rigid = {}, {}
    for name, part in tissue.rigid.items():
        rigid[name] = frame.bones[part.bone]
        if name in dataset.nails:
            points = tissue.skin.vertices[part.vertices]
            correction = fit_correction(points, frame.bones[part.bone], scan)
            nails[name] = as_vector(correction, points.mean(axis=0))
            rigid[name] = frame.bones[part.bone] @ correction
    name = f"strains of the fat in {frame.name}"
    fit = fit_strains(tissue, below, rigid, scan, tissue.pose(frame.bones), FitSettings(), name)
    record = {key: [row[key] for row in fit.record] for key in fit.record[0]}
    data = {"log_strains": fit.log_strains, "vertices": fit.vertices, "nails": nails, "record": record}
    data["figures"] = fit.figures
    artifacts.write(
        output,
        data,
        kind="fat_fit",
        units={"vertices": "mm", "record/mean_gap": "mm"} | figure_units(fit.figures),
        inputs=[inputs.mesh, inputs.inner, inputs.scan],
    )
