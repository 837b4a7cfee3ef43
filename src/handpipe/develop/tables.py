"""Write Tables 1 to 3 of Zheng 2022 for a built subject: python -m handpipe.develop.tables SUBJECT_FOLDER...

Table 1 counts vertices and elements by tissue, Table 2 gives parameters, Table 3 frames and seconds by scene.
A fourth table gives the seconds of each stage. Counts and parameters are read from artifacts, the seconds of
stages from Snakemake's benchmark files, those of frames and their layers from the simulation's logs.
"""

from __future__ import annotations

import argparse
import csv
import io
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from handpipe.core import InputError, Parser, artifacts, reported
from handpipe.develop.results import build_commit, machine
from handpipe.evaluation import Job, read_jobs

PAGE = Path("docs/tables.md")
Cell = str | int | float


@dataclass(frozen=True)
class TissueMeshes:
    """Where the meshes of a tissue are: files of a subject's folder, arrays in each, the paper's row."""

    name: str
    method: str
    files: str
    vertices: str
    cells: str
    published: str


CLOTH = ("surface/vertices", "surface/triangles")
# Published: vertices and triangles or tets, sums over the tissue, of Zheng 2022 Table 1.
TISSUES = (
    TissueMeshes(
        "bones", "skinning", "rig.h5", "surfaces/*/vertices", "surfaces/*/triangles", "77,771; 155,450"
    ),
    TissueMeshes(
        "muscles", "volumetric", "muscles/*/strains.h5", "body/mesh/vertices", "body/mesh/tets",
        "26,857; 111,614",
    ),
    TissueMeshes("tendons", "rod", "tendons/*/neutral.h5", "x", "", "3,210"),
    TissueMeshes("bone fascia", "cloth", "fascia/bone.h5", *CLOTH, "23,829; 47,654"),
    TissueMeshes("muscle fascia", "cloth", "fascia/muscle.h5", *CLOTH, "26,740; 53,444"),
    TissueMeshes("ligaments", "volumetric", "ligaments/*.h5", "body/mesh/vertices", "body/mesh/tets", ""),
    TissueMeshes("fat", "volumetric", "fat/mesh.h5", "mesh/vertices", "mesh/tets", "48,672; 227,314"),
    TissueMeshes("skin", "embedded in the fat", "skin.h5", "vertices", "triangles", ""),
)  # fmt: skip
# What it is, its file, array and unit, and the published value (Zheng 2022 Table 2).
PARAMETERS = (
    ("bone fascia E", "fascia/bone.h5", "settings/young", "kPa", "0.1 kPa"),
    ("bone fascia nu", "fascia/bone.h5", "settings/poisson", "", "0.48"),
    ("bone fascia rest size", "fascia/bone.h5", "settings/shrink", "", "35 % (UV scale)"),
    ("muscle fascia E", "fascia/muscle.h5", "settings/young", "kPa", "0.1 kPa"),
    ("muscle fascia nu", "fascia/muscle.h5", "settings/poisson", "", "0.48"),
    ("muscle fascia rest size", "fascia/muscle.h5", "settings/shrink", "", "40 % (UV scale)"),
    ("fat E", "fat/mesh.h5", "settings/young", "kPa", "1 kPa"),
    ("fat nu", "fat/mesh.h5", "settings/poisson", "", "0.48"),
)
RULES = {
    "bones": "propose_seeds segment_pose correct_bone merge_labels register_bones carry_template fit_rig",
    "tendons": "extract_tendon register_tendon fit_hooks",
    "muscles": (
        "place_templates extract_muscle separate_neutral extract_muscle_shapes separate_muscles "
        "fit_muscle_strains"
    ),
    "ligaments": "fit_ligament",
    "bone fascia": "make_bone_fascia",
    "muscle fascia": "make_muscle_fascia",
    "fat and skin": (
        "extract_skin make_skin mesh_fat mesh_flesh mesh_soft_tissue mesh_crease_tissue "
        "fit_fat_strains collect_fat_strains simulate_skin"
    ),
    "layers under the fat": "simulate_flesh simulate_inner",
    "scenes": "simulate export_scene export_obj",
}
LAYER_TIME = re.compile(r"frame (?P<frame>.+): (?P<layer>\w+) in (?P<seconds>[0-9.]+) s$")


@dataclass(frozen=True)
class PageTable:
    """A table of a page, and the name of its CSV file."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: list[tuple[Cell, ...]]

    def markdown(self) -> list[str]:
        """Lines of the table."""
        rule = "| --- " * len(self.columns) + "|"
        rows = [f"| {' | '.join(_shown(cell) for cell in row)} |" for row in self.rows]
        return [f"**{self.title}**", "", f"| {' | '.join(self.columns)} |", rule, *rows]

    def csv(self) -> str:
        """Text of the table with all digits."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.columns, *self.rows])
        return text.getvalue()


def _shown(cell: Cell) -> str:
    if isinstance(cell, str):
        return cell
    return f"{cell:,}" if isinstance(cell, int) else f"{cell:,.3g}" if cell < 100 else f"{cell:,.0f}"


def tables(folder: Path) -> list[PageTable]:
    """All tables of a subject.

    Parameters
    ----------
    folder : Path
        Results folder of the subject.

    Raises
    ------
    InputError
        If the folder has no rig: nothing is built in it.
    """
    if not (folder / "rig.h5").exists():
        raise InputError(folder, "rig.h5", "is not there", "Build the subject first")
    return [_meshes(folder), _parameters(folder), _scenes(folder), _stages(folder)]


def _meshes(folder: Path) -> PageTable:
    rows = [row for tissue in TISSUES if (row := _mesh_row(folder, tissue))]
    heads = ("tissue", "method", "meshes", "vertices, least", "most", "mean", "sum", "triangles or tets")
    published = "Zheng 2022: vertices; triangles or tets"
    return PageTable("meshes", "Table 1. Meshes of all tissues.", (*heads, published), rows)


def _mesh_row(folder: Path, tissue: TissueMeshes) -> tuple[Cell, ...]:
    vertices: list[int] = []
    cells = 0
    for path in sorted(folder.glob(tissue.files)):
        with h5py.File(path, "r") as file:
            vertices += _lengths(file, tissue.vertices)
            cells += sum(_lengths(file, tissue.cells)) if tissue.cells else 0
    if not vertices:
        return ()
    figures = (len(vertices), min(vertices), max(vertices), round(np.mean(vertices)), sum(vertices))
    return (tissue.name, tissue.method, *figures, cells or "", tissue.published)


def _lengths(file: h5py.File, array: str) -> list[int]:
    """Lengths of an array; "*" in its name stands for every group."""
    before, star, after = array.partition("/*/")
    names = [f"{before}/{name}/{after}" for name in file[before]] if star else [array]
    return [len(file[name]) for name in names]


def _parameters(folder: Path) -> PageTable:
    rows: list[tuple[Cell, ...]] = []
    for text, name, array, unit, published in PARAMETERS:
        if (folder / name).exists():
            with h5py.File(folder / name, "r") as file:
                rows.append((text, float(file[array][()]), unit, published))
    title = "Table 2. Parameters of the simulation that artifacts hold."
    return PageTable("parameters", title, ("parameter", "value", "unit", "Zheng 2022"), rows)


def _scenes(folder: Path) -> PageTable:
    timed = {path.name: layer_seconds(path) for path in sorted((folder / "logs/simulate").glob("*"))}
    layers = list(dict.fromkeys(layer for frames in timed.values() for f in frames.values() for layer in f))
    rows: list[tuple[Cell, ...]] = []
    for scene, frames in timed.items():
        totals = [sum(frame.values()) for frame in frames.values()]
        if sum(totals) == 0.0:
            continue
        shares = [100 * sum(f.get(n, 0.0) for f in frames.values()) / sum(totals) for n in layers]
        figures = (len(totals), float(np.mean(totals)), max(totals), sum(totals) / 3600)
        rows.append((scene, *figures, *(round(share, 1) for share in shares)))
    heads = (
        "scene",
        "frames",
        "s a frame, mean",
        "s a frame, most",
        "h in all",
        *(f"{n}, %" for n in layers),
    )
    return PageTable("scenes", "Table 3. The time cost of each scene, and each layer's share.", heads, rows)


def layer_seconds(logs: Path) -> Mapping[str, Mapping[str, float]]:
    """Seconds of the last simulation of each frame.

    Parameters
    ----------
    logs : Path
        Folder with the logs of a scene's chunks.

    Returns
    -------
    mapping of str to mapping of str to float
        By frame and layer.
    """
    found: dict[str, dict[str, float]] = defaultdict(dict)
    for path in sorted(logs.glob("*.log")):
        for line in path.read_text(encoding="utf-8").splitlines():
            if match := LAYER_TIME.search(line):
                found[match["frame"]][match["layer"]] = float(match["seconds"])
    return found


def _stages(folder: Path) -> PageTable:
    by_rule: dict[str, list[Job]] = defaultdict(list)
    for job in read_jobs(folder / "benchmarks"):
        by_rule[job.rule].append(job)
    known = {rule: layer for layer, rules in RULES.items() for rule in rules.split()}
    order = [*known, *sorted(set(by_rule) - set(known))]
    rows: list[tuple[Cell, ...]] = [
        (known.get(rule, "other"), rule, len(jobs), *_costs(jobs))
        for rule in order
        if (jobs := by_rule.get(rule))
    ]
    heads = ("layer", "stage", "jobs", "s", "s of processor", "longest job, s", "peak memory, GiB")
    return PageTable("stages", "Seconds of each stage.", heads, rows)


def _costs(jobs: Sequence[Job]) -> tuple[float, ...]:
    seconds = [job.seconds for job in jobs]
    return sum(seconds), sum(j.cpu_seconds for j in jobs), max(seconds), max(j.peak_memory for j in jobs)


def page(subjects: Mapping[Path, Sequence[PageTable]]) -> str:
    """The page in Markdown.

    Parameters
    ----------
    subjects : mapping of Path to sequence of PageTable
        Tables of subjects by their results folders, all of one build.
    """
    lines = [
        "# Tables of the papers for built subjects",
        "",
        "This page is generated by `python -m handpipe.develop.tables`. Do not edit it. Published values are",
        "of another hand. Seconds are by the clock, on a machine that may have run other jobs.",
        "",
        f"Commit {build_commit([*subjects])}. Machine that made this page: {machine()}.",
    ]
    for folder, found in subjects.items():
        lines += ["", f"## {folder.name}", *(line for table in found for line in ("", *table.markdown()))]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Write the page, and CSV files if asked for; return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.tables", description=__doc__.splitlines()[0])
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folders", metavar="SUBJECT_FOLDER", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, default=PAGE)
    parser.add_argument("--csv", type=Path, help="folder for {subject}-{table}.csv")
    options = parser.parse_args(arguments)
    with reported() as failure:
        subjects = {folder: tables(folder) for folder in options.folders}
        artifacts.write_text(options.output, page(subjects))
        for folder, found in subjects.items() if options.csv else ():
            for table in found:
                artifacts.write_text(options.csv / f"{folder.name}-{table.name}.csv", table.csv())
    return failure.code


if __name__ == "__main__":
    raise SystemExit(main())
