"""Write the page of results from the metrics of a build: python -m handpipe.develop.results SUBJECT_FOLDER...

The page names the commit, the machine and the date. Artifacts record the commit that made them: the command
refuses a build whose artifacts are of several commits, of changed files, or of an unknown commit.
"""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from handpipe.core import InputError, Metrics, Parser, artifacts, metrics, reported
from handpipe.evaluation import SKIN_MODELS
from handpipe.stages.baselines.variants import PASSIVE, VARIANTS

PAGE = Path("docs/results.md")
REMEDY = "Build the subject anew from one commit: remove its folder and run snakemake"


@dataclass(frozen=True)
class Figure:
    """A row of the page: what it is, where it stands, and the published value where there is one."""

    text: str
    stage: str
    names: tuple[str, ...]
    published: str = ""


def _figure(text: str, where: str, published: str = "") -> Figure:
    stage, names = where.split(": ")
    return Figure(text, stage, tuple(names.split(", ")), published)


TABLE4 = "(Zheng 2022 Table 4)"
FIGURES = (
    _figure("processor time of all jobs", "build: cpu_seconds"),
    _figure("from the first start to the last end", "build: wall_seconds"),
    _figure("largest memory of one job", "build: peak_memory"),
    _figure("bones that need a person after neutral", "seeds: manual_bones"),
    _figure("Dice, mean and least", "segmentation: dice_mean, dice_min"),
    _figure("registration, mean", "registration: rotation_error_mean, translation_error_mean"),
    _figure("registration, largest", "registration: rotation_error_max, translation_error_max"),
    _figure(
        "rig, fitted poses, mean", "rig: rotation_error_mean, translation_error_mean", "1.84 deg, 0.45 mm "
        "(Wang 2019 Table 1)",
    ),
    _figure("rig, pose left out, mean", "rig: loo_rotation_error_mean, loo_translation_error_mean"),
    _figure("rig, held-out poses, mean", "rig: heldout_rotation_error_mean, heldout_translation_error_mean"),
    _figure("tendon centreline, examples, mean", "tendons: centreline_error_mean"),
    _figure("tendon centreline, held out, mean", "tendons: heldout_centreline_error_mean"),
    _figure("tendon length change, largest", "tendons: length_change_max"),
    _figure("muscle surface, examples, mean and largest", "muscles: surface_error_mean, surface_error_max"),
    _figure("muscle surface, held out, mean", "muscles: heldout_surface_error_mean"),
    _figure("penetration of muscles after separation", "muscles: penetration_max"),
    _figure("skin to scan by m0, examples, mean", "skin: example_error_mean", f"0.17 mm {TABLE4}"),
    _figure("skin to scan by m1, examples, mean", "baselines: m1_example_error_mean", f"0.87 mm {TABLE4}"),
    _figure("skin to scan by m2, examples, mean", "baselines: m2_example_error_mean", f"1.24 mm {TABLE4}"),
    _figure("skin to scan by m0, held out, mean", "skin: heldout_error_mean", f"0.72 mm {TABLE4}"),
    _figure("skin to scan by m1, held out, mean", "baselines: m1_heldout_error_mean", f"0.91 mm {TABLE4}"),
    _figure("skin to scan by m2, held out, mean", "baselines: m2_heldout_error_mean", f"1.11 mm {TABLE4}"),
    _figure("skin to true skin by m0, examples, mean", "skin: true_example_error_mean"),
    _figure("skin to true skin by m0, held out, mean", "skin: true_heldout_error_mean"),
)  # fmt: skip

# Heads of tables of models, and what the names of figures have after the model's.
OF_SKINS = {
    "to scan, examples": "example_error",
    "to scan, held out": "heldout_error",
    "to true skin, examples": "true_example_error",
    "to true skin, held out": "true_heldout_error",
}
OF_VARIANTS = OF_SKINS | {
    "without strains, to true skin, held out": f"{PASSIVE.removeprefix('_')}_true_heldout_error",
    "tendons, held out": "tendons_heldout_error",
    "muscles, held out": "muscles_heldout_error",
}


def build_commit(folders: Sequence[Path]) -> str:
    """The commit that made all artifacts of the folders.

    Parameters
    ----------
    folders : sequence of Path
        Results folders of subjects.

    Raises
    ------
    InputError
        If the artifacts are of several commits, of changed files, or of an unknown commit.
    """
    made: dict[str, list[Path]] = {}
    for folder in folders:
        for path in sorted(folder.rglob("*.h5")):
            made.setdefault(str(artifacts.read_attributes(path).get("commit", "")), []).append(path)
    if not made:
        raise InputError(folders[0], "artifacts", "are not there", REMEDY)
    if len(made) > 1:
        counts = ", ".join(f"{c[:7] or 'unknown'}: {len(p)}, such as {p[0]}" for c, p in made.items())
        raise InputError(folders[0], "commit", f"differs between artifacts ({counts})", REMEDY)
    commit = next(iter(made))
    if not commit or commit.endswith("-dirty"):
        raise InputError(folders[0], "commit", f"is {commit or 'unknown'}", f"Commit all changes. {REMEDY}")
    return commit


def stage_figures(folder: Path) -> dict[str, Metrics]:
    """The metrics of all stages of a subject, by stage.

    Parameters
    ----------
    folder : Path
        Results folder of a subject.

    Raises
    ------
    InputError
        If there are none, or some are older than every artifact: those are of an earlier build.
    """
    files = sorted((folder / "metrics").glob("*.json"))
    if not files:
        raise InputError(folder, "metrics", "are not there", REMEDY)
    _check_ages(folder, files)
    return {path.stem: metrics.read(path) for path in files}


def page(folders: Sequence[Path]) -> str:
    """The page in Markdown.

    Parameters
    ----------
    folders : sequence of Path
        Results folders of subjects, all of one build.
    """
    commit = build_commit(folders)
    lines = [
        "# Results",
        "",
        "This page is generated by `python -m handpipe.develop.results`. Do not edit it. Models of the skin:",
        "m0 has all layers, m1 has fat without plastic strains, m2 has one soft tissue around the bones.",
        "Tables of [simpler models](methods.md#simpler-models-beside-the-full-one) and of",
        "[variants of m0](methods.md#variants-of-the-full-model) have the mean over the poses; the largest",
        "distance.",
        "Published values were measured on real scans of other hands and are given for scale only.",
        "[Limits](limitations.md) says what the figures do not show.",
        "",
        f"Commit {commit}. Machine that made this page: {machine()}.",
    ]
    for folder in folders:
        lines += ["", f"## {folder.name}", "", *_section(folder)]
    return "\n".join(lines) + "\n"


def machine() -> str:
    """Processor, its number of logical cores, and the system."""
    cpuinfo = Path("/proc/cpuinfo")
    text = cpuinfo.read_text() if cpuinfo.exists() else ""
    names = [line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name")]
    processor = names[0] if names else platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count()} cores, {platform.system()}"


def _section(folder: Path) -> Iterator[str]:
    known, files = stage_figures(folder), sorted((folder / "metrics").glob("*.json"))
    built = datetime.fromtimestamp(max(path.stat().st_mtime for path in files), UTC)
    yield from (
        f"Built {built:%Y-%m-%d}.",
        "",
        "| figure | metric | value | published |",
        "| --- | --- | --- | --- |",
    )
    for figure in FIGURES:
        values = [known.get(figure.stage, {}).get(name) for name in figure.names]
        if None not in values:
            shown = ", ".join(_value(*value) for value in values if value is not None)
            where = ", ".join(f"`{name}`" for name in figure.names)
            yield f"| {figure.text} | `{figure.stage}`: {where} | {shown} | {figure.published} |"
    if "baselines" in known:
        rows = _models(known["baselines"], SKIN_MODELS, OF_SKINS)
        yield from ("", f"### Simpler models, {folder.name}", "", *rows)
    if "ablations" in known:
        yield from ("", f"### Variants of the full model, {folder.name}", "", *_variants(known["ablations"]))


def _variants(figures: Metrics) -> Iterator[str]:
    """Rows of the table of the full model and its variants; the last columns are the skin over joints."""
    marks = {n.removeprefix("m0_").removesuffix("_error_mean") for n in figures if n.startswith("m0_")}
    knuckles = sorted(m for m in marks if m.endswith("_knuckle") and PASSIVE[1:] not in m)
    over = {f"over {name.removesuffix('_knuckle')}": f"{name}_error" for name in knuckles}
    rows = {"m0": SKIN_MODELS["m0"]} | {name: f"`{name}`: {v.text}" for name, v in VARIANTS.items()}
    yield from _models(figures, rows, OF_VARIANTS | over)


def _models(figures: Metrics, models: Mapping[str, str], columns: Mapping[str, str]) -> Iterator[str]:
    """Rows of a table of the skin's models: the mean over the poses and the largest distance."""
    yield f"| model | {' | '.join(columns)} |"
    yield "| --- " * (1 + len(columns)) + "|"
    for model, text in models.items():
        cells = []
        for column in columns.values():
            found = [figures.get(f"{model}_{column}_{kind}") for kind in ("mean", "max")]
            cells.append("; ".join(_value(*value) for value in found if value is not None))
        yield f"| {text} | {' | '.join(cells)} |"


def _check_ages(folder: Path, files: Sequence[Path]) -> None:
    """Metrics do not record a commit: those of an earlier build are older than all artifacts of this one."""
    first = min(path.stat().st_mtime for path in folder.rglob("*.h5"))
    for path in files:
        if path.stat().st_mtime < first:
            raise InputError(path, "date", "is older than every artifact of the build", REMEDY)


def _value(value: float, unit: str) -> str:
    return f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"


def main(arguments: list[str] | None = None) -> int:
    """Write the page and return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.results", description=__doc__.splitlines()[0])
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folders", metavar="SUBJECT_FOLDER", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, default=PAGE)
    options = parser.parse_args(arguments)
    with reported() as failure:
        artifacts.write_text(options.output, page(options.folders))
    return failure.code


if __name__ == "__main__":
    raise SystemExit(main())
