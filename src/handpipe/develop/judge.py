"""Gather the figures of test hands by hand and over hands: python -m handpipe.develop.judge SUBJECT_FOLDER...

The protocol is docs/judge.md: test hands are run once, at a freeze, and reported whatever they say. The
command refuses builds of several commits or of another commit than the freeze, and hands without the figures
of a stage. Hands of one freeze may be built and judged in turn: a record keeps the figures of those before.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from handpipe.core import InputError, Metrics, Parser, artifacts, metrics, paths, reported
from handpipe.core.configuration import Model, load_yaml
from handpipe.develop.results import build_commit, machine, stage_figures

KINDS = Path("config/judge.yaml")
FIGURES, PAGE = Path("results/benchmarks/judge.json"), Path("docs/judge-figures.md")
RECORD = Path("docs/judged-hands.json")
MODELS = ("m0", "m1", "m2", "m3")
OTHERS = MODELS[1:]  # of which m0 is compared with the best
# Text, stage and metric of each row of a table; all are of one value and unit.
ROWS = (
    *(
        (f"{model}, skin to {place}, {poses}", "baselines", f"{model}_{kind}{role}_error_mean")
        for kind, place in (("", "scan"), ("true_", "true skin"))
        for role, poses in (("example", "examples"), ("heldout", "held out"))
        for model in MODELS
    ),
    ("muscle surface, examples, mean", "muscles", "surface_error_mean"),
    ("muscle surface, held out, mean", "muscles", "heldout_surface_error_mean"),
    ("muscle surface, held out, largest", "muscles", "heldout_surface_error_max"),
    ("tendon centreline, examples, mean", "tendons", "centreline_error_mean"),
    ("tendon centreline, held out, mean", "tendons", "heldout_centreline_error_mean"),
    ("rig, held out, mean turn", "rig", "heldout_rotation_error_mean"),
    ("rig, held out, mean shift", "rig", "heldout_translation_error_mean"),
)
# The same of a stage that a hand may lack: of freezes before the page had these rows.
COVERAGE_ROWS = tuple(
    (f"within two stated deviations, held out, {of}", "deviations", f"coverage_two_deviations_heldout{kind}")
    for of, kind in (
        ("mean of the kinds", ""),
        *((kind, f"_{kind}") for kind in ("bones", "tendons", "muscles", "skin")),
    )
)
RATIO = "m0_over_best"  # true skin, held out: m0's mean over the least of the other models'
COMPLETE = "complete"  # 1 where the build came to its end, 0 where a frame of its scenes failed
Hands = Mapping[str, Metrics]


class HandKinds(Model):
    """Which hands the method was chosen by, and which it is judged on."""

    validation: tuple[str, ...]
    test: tuple[str, ...]
    one_hand: tuple[tuple[str, ...], ...] = ()

    def require(self, folders: Sequence[Path]) -> None:
        """Refuse hands of neither kind, one hand twice, and validation hands alone: `InputError`."""
        names = [folder.name for folder in folders]
        known = f"Validation: {', '.join(self.validation)}; test: {', '.join(self.test)}"
        for folder in folders:
            if folder.name not in (*self.validation, *self.test):
                raise InputError(folder, "name", "is neither a validation hand nor a test hand", known)
        for group in (*self.one_hand, *((name,) for name in names)):
            if sum(name in group for name in names) > 1:
                problem = f"{' and '.join(dict.fromkeys(n for n in names if n in group))}: one hand twice"
                raise InputError(folders[0], "name", problem, "Give it once")
        if not set(names) & set(self.test):
            raise InputError(folders[0], "name", "is no test hand, nor is any other", known)


def figures_by_hand(folders: Sequence[Path]) -> dict[str, Metrics]:
    """The figures of each hand by `{stage}_{metric}`, and the ratio of m0 to the best other model.

    Parameters
    ----------
    folders : sequence of Path
        Results folders of subjects.

    Raises
    ------
    InputError
        If a figure is absent.
    """
    found: dict[str, Metrics] = {}
    for folder in folders:
        stages, own = stage_figures(folder), Metrics()
        for _, stage, name in ROWS:
            if name not in stages.get(stage, {}):
                file = folder / "metrics" / f"{stage}.json"
                raise InputError(file, name, "is not there", "Build `all` and `baselines` of this subject")
            own[f"{stage}_{name}"] = stages[stage][name]
        for _, stage, name in COVERAGE_ROWS:
            if name in stages.get(stage, {}):
                own[f"{stage}_{name}"] = stages[stage][name]
        true = {model: own[f"baselines_{model}_true_heldout_error_mean"][0] for model in MODELS}
        own[RATIO] = (true["m0"] / min(true[model] for model in OTHERS), "1")
        own[COMPLETE] = (float((folder / paths.below(paths.COMPLETE)).is_file()), "1")
        found[folder.name] = own
    return found


def over_hands(hands: Hands) -> Metrics:
    """Means, spread and worst over hands.

    Parameters
    ----------
    hands : mapping of str to Metrics
        Figures of `figures_by_hand`; at least one hand.

    Returns
    -------
    Metrics
        `hands`, how many were built to their ends, four figures that aims are stated of, coverage where it
        was measured, `{figure}_over_hands_mean` and `_sd` (of a sample, from two hands on), and each
        hand's own as `{hand}: {figure}`.
    """

    def values(name: str) -> list[float]:
        return [own[name][0] for own in hands.values() if name in own]

    found: Metrics = {
        "hands": (len(hands), "1"),
        "hands_complete": (sum(values(COMPLETE)), "1"),
        "m0_over_best_heldout": (float(np.mean(values(RATIO))), "1"),
        "heldout_skin_mean_worst_hand": (max(values("baselines_m0_heldout_error_mean")), "mm"),
        "heldout_muscle_mean": (float(np.mean(values("muscles_heldout_surface_error_mean"))), "mm"),
        "heldout_muscle_max": (max(values("muscles_heldout_surface_error_max")), "mm"),
    }
    covered = values("deviations_coverage_two_deviations_heldout")
    if covered:
        found["coverage_two_deviations"] = (float(np.mean(covered)), "1")
        found["coverage_hands"] = (len(covered), "1")
    for name, unit in {name: unit for own in hands.values() for name, (_, unit) in own.items()}.items():
        found[f"{name}_over_hands_mean"] = (float(np.mean(values(name))), unit)
        if len(values(name)) > 1:
            found[f"{name}_over_hands_sd"] = (float(np.std(values(name), ddof=1)), unit)
    return found | {f"{hand}: {name}": value for hand, own in hands.items() for name, value in own.items()}


def require_freeze(commit: str, tag: str) -> None:
    """Refuse a build of another commit than the one of a tag.

    Parameters
    ----------
    commit : str
        Commit of a build.
    tag : str
        Tag of the freeze.

    Raises
    ------
    InputError
        If there is no such tag, or it names another commit.
    """
    asked = ("git", "rev-parse", "--verify", "--quiet", f"refs/tags/{tag}^{{commit}}")
    frozen = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    if not frozen:
        raise InputError("git", "tag", f"{tag!r} is not there", "Set the tag before test hands are built")
    if frozen != commit:
        problem = f"{commit[:7]} of the build is not {frozen[:7]} of the tag {tag}"
        raise InputError("build", "commit", problem, "Build all test hands anew at the freeze")


def read_record(path: Path, commit: str) -> dict[str, Metrics]:
    """Figures of the hands that were judged at a commit before; none where the record is of another commit.

    Parameters
    ----------
    path : Path
        File that `write_record` wrote; it may be absent.
    commit : str
        Commit of the freeze.

    Raises
    ------
    InputError
        If the file is no such record.
    """
    if not path.is_file():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        hands = {
            hand: {name: (float(value), str(unit)) for name, (value, unit) in own.items()}
            for hand, own in found["hands"].items()
        }
        return hands if found["commit"] == commit else {}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(path, "hands", f"is no record ({error})", "Restore it, or remove it") from error


def write_record(path: Path, hands: Hands, commit: str) -> None:
    """Keep the figures of the hands that were judged at a commit."""
    record = {"commit": commit, "hands": {hand: dict(sorted(own.items())) for hand, own in hands.items()}}
    artifacts.write_text(path, json.dumps(record, indent=1) + "\n")


def judge_page(hands: Hands, kinds: HandKinds, commit: str, freeze: str | None) -> str:
    """The tables in Markdown, those of test hands and of validation hands apart."""
    frozen = (
        f"the freeze `{freeze}`" if freeze else "no freeze was stated: these are no figures of the protocol"
    )
    lines = [
        "# Figures of the test hands",
        "",
        "This page is generated by `python -m handpipe.develop.judge`. Do not edit it.",
        "[Test hands and validation hands](judge.md) has the protocol.",
        "Means over poses in mm, rig in degrees and mm; sd: deviation of a sample over hands.",
        "",
        f"Commit {commit} ({frozen}). Machine that made this page: {machine()}.",
    ]
    for title, names in (("Test hands", kinds.test), ("Validation hands", kinds.validation)):
        chosen = {name: own for name, own in hands.items() if name in names}
        if chosen:
            lines += ["", f"## {title}", "", *_table(chosen, over=names is kinds.test)]
    return "\n".join(lines) + "\n"


def _table(hands: Hands, *, over: bool) -> Iterator[str]:
    """Rows of the figures by hand; over: also the mean and the deviation over hands."""
    yield f"| figure | {' | '.join(hands)} |" + (" mean | sd |" if over else "")
    yield "| --- " * (len(hands) + 1 + 2 * over) + "|"
    rows = [(text, f"{stage}_{name}") for text, stage, name in (*ROWS, *COVERAGE_ROWS)]
    rows.append(("m0 over the best of m1, m2, m3, true skin, held out", RATIO))
    rows.append(("built to its end (1), or a frame of its scenes failed (0)", COMPLETE))
    for text, name in rows:
        values = [own[name][0] for own in hands.values() if name in own]
        if not values:
            continue
        cells = [f"{own[name][0]:.3g}" if name in own else "" for own in hands.values()]
        if over:
            cells += [f"{np.mean(values):.3g}", f"{np.std(values, ddof=1):.3g}" if len(values) > 1 else ""]
        yield f"| {text} | {' | '.join(cells)} |"


def main(arguments: list[str] | None = None) -> int:
    """Write the figures and the page; return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.judge", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folders", metavar="SUBJECT_FOLDER", nargs="+", type=Path)
    parser.add_argument("--freeze", help="tag of the commit at which all hands must have been built")
    parser.add_argument(
        "--record", type=Path, default=RECORD, help="figures of one freeze's hands; another's are replaced"
    )
    parser.add_argument("--kinds", type=Path, default=KINDS, help="file of validation and test hands")
    parser.add_argument("--figures", type=Path, default=FIGURES)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args(arguments)
    with reported() as failure:
        kinds = load_yaml(options.kinds, HandKinds)
        kinds.require(options.folders)
        commit = build_commit(options.folders)
        if options.freeze:
            require_freeze(commit, options.freeze)
        hands = figures_by_hand(options.folders)
        if options.freeze:
            gathered = read_record(options.record, commit) | hands
            kinds.require([Path(name) for name in gathered])
            hands = {name: gathered[name] for name in (*kinds.validation, *kinds.test) if name in gathered}
            write_record(options.record, hands, commit)
        tested = {name: own for name, own in hands.items() if name in kinds.test}
        metrics.write(options.figures, over_hands(tested))
        artifacts.write_text(options.page, judge_page(hands, kinds, commit, options.freeze))
    return failure.code


if __name__ == "__main__":
    raise SystemExit(main())
