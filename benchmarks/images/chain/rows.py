"""Rows of the chain: each effect alone, all together, voxel sizes and noise; kept as they are measured."""

from __future__ import annotations

import json
import logging
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.images import rows as bones
from benchmarks.images.chain import subject, verdicts
from benchmarks.images.chain.stages import Chain, Word
from benchmarks.images.chain.verdicts import Error
from benchmarks.images.subject import Setting
from handpipe.core import CodeDigests, Metrics, write_text
from handpipe.synthetic.acquisition.physics.effects import EFFECTS

log = logging.getLogger(__name__)

VOXEL = 0.8  # mm, of the generated finger
VOXELS = (0.5, 0.8, 1.0)  # mm of the sweep


@dataclass(frozen=True)
class Row:
    """What came of a setting.

    effect: name of the effect, or what is imaged; voxel: mm; errors: every figure against truth; said: the
    library's words; seconds: the processor's by stage.
    """

    effect: str
    strength: str
    voxel: float
    errors: list[Error]
    said: list[Word]
    seconds: dict[str, float]

    @property
    def name(self) -> str:
        """Its key among other rows."""
        return f"{self.effect}, {self.strength}, {self.voxel:g} mm"

    @property
    def heard(self) -> set[str]:
        """Organs that something was said of: of all, where the neutral pose was refused."""
        about = {organ for word in self.said for organ in word.about()}
        return about | ({e.organ for e in self.errors} if self.refused else set())

    @property
    def refused(self) -> set[str]:
        """Bones for which the neutral pose was refused; nothing is built then."""
        bones = [e for e in self.errors if e.kind == "Dice"]
        if any(e.value is not None for e in bones):
            return set()
        return {organ for word in self.said if word.ended for organ in word.about()}

    @property
    def wrong(self) -> list[Error]:
        """Figures that are not right."""
        return [e for e in self.errors if e.wrong]

    @property
    def stated(self) -> list[Error]:
        """Those of them that the registration states itself, in organs of which nothing else was said."""
        return [e for e in self.wrong if e.organ not in self.heard and e.expected]

    @property
    def silent(self) -> list[Error]:
        """Those of organs of which nothing was said, and that are not stated."""
        return [e for e in self.wrong if e.organ not in self.heard and not e.expected]

    @property
    def alarms(self) -> list[str]:
        """Right organs of which something was said."""
        organs = dict.fromkeys(e.organ for e in self.errors)
        return [o for o in organs if o in self.heard and o not in {e.organ for e in self.wrong}]

    def worst(self, *kinds: str) -> float | None:
        """The worst figure of a kind."""
        values = [e.value for e in self.errors if e.kind in kinds and e.value is not None]
        return (min if "Dice" in kinds else max)(values, default=None)


@dataclass(frozen=True)
class Case:
    """A row that is to be measured."""

    effect: str
    strength: str
    setting: Setting

    @property
    def name(self) -> str:
        """The key of its row."""
        return f"{self.effect}, {self.strength}, {self.setting.spacing:g} mm"


def cases(spacing: float = VOXEL) -> list[Case]:
    """Each effect alone at both strengths, and all together at usual strength, in a voxel size in mm."""
    found = [Case("spin echo without effects", "none", Setting())]
    found += [Case(e, s, Setting(strengths=((e, s),))) for e in EFFECTS for s in bones.STRENGTHS]
    found += [Case("all effects", "usual", Setting(others="usual"))]
    return [replace(case, setting=replace(case.setting, spacing=spacing)) for case in found]


def sweep() -> list[Case]:
    """Speed against error: strengths of noise alone, and all effects, in several voxel sizes."""
    found = []
    for spacing in VOXELS:
        found += [
            Case("noise", s, Setting(strengths=(("noise", s),), spacing=spacing)) for s in bones.STRENGTHS
        ]
        found.append(Case("all effects", "usual", Setting(others="usual", spacing=spacing)))
    return found


def file_in(folder: Path) -> Path:
    """Where rows are kept while they are measured; a change of the code has a file of its own."""
    root = Path(__file__).parents[3]
    code = CodeDigests((root / "src" / "handpipe", root / "benchmarks")).digest(Path(__file__))
    return folder / f"chain-rows-{code[:12]}.json"


def measured(wanted: Iterable[Case], kept: Path) -> Iterator[Row]:
    """The rows of cases, each read from a file of rows or measured and added to it."""
    known = read(kept)
    for case in wanted:
        if case.name not in known:
            known[case.name] = measure(case)
            kept.parent.mkdir(parents=True, exist_ok=True)
            write_text(kept, json.dumps({name: asdict(row) for name, row in known.items()}, indent=1) + "\n")
        yield known[case.name]


def read(kept: Path) -> dict[str, Row]:
    """Rows of a file by name, if there is one."""
    found = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    return {name: _row(row) for name, row in found.items()}


def _row(row: dict[str, Any]) -> Row:
    errors, said = [Error(**e) for e in row["errors"]], [Word(**w) for w in row["said"]]
    return Row(**{**row, "errors": errors, "said": said})


def measure(case: Case) -> Row:
    """Image the finger, run the stages and judge every organ."""
    folder = Path(tempfile.mkdtemp(prefix="finger-"))
    try:
        dataset = subject.dataset_in(folder / "data")
        subject.write_templates(dataset)
        subject.write_images(dataset, case.setting)
        chain = Chain(dataset, folder)
        chain.run()
        errors = verdicts.errors(chain, case.setting.displacement)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    spacing = case.setting.spacing
    row = Row(case.effect, case.strength, spacing, errors, chain.said, chain.seconds)
    silent, seconds = [str(e) for e in row.silent], sum(row.seconds.values())
    log.info("%s: wrong %s; silent %s; %.1f s", row.name, [str(e) for e in row.wrong], silent, seconds)
    return row


def figures(rows: Sequence[Row]) -> Metrics:
    """How many effects the chain was run under, and in how many rows a wrong organ is silent."""
    return {
        "chain_effects": (len({row.effect for row in rows} & set(EFFECTS)), "1"),
        "chain_effects_rows": (len(rows), "1"),
        "chain_effects_silent": (sum(bool(row.silent) for row in rows), "1"),
        "chain_effects_wrong": (sum(bool(row.wrong) for row in rows), "1"),
        "chain_effects_refused": (sum(bool(row.refused) for row in rows), "1"),
        "chain_effects_false_alarms": (sum(len(row.alarms) for row in rows), "1"),
        "chain_effects_seconds": (_seconds(rows), "s"),
    }


def sweep_figures(rows: Sequence[Row]) -> Metrics:
    """The same of the sweep of voxels and noise, and seconds by voxel size."""
    found: Metrics = {"chain_sweep_silent": (sum(bool(row.silent) for row in rows), "1")}
    for spacing in VOXELS:
        there = [row for row in rows if row.voxel == spacing and not row.refused]
        name = f"chain_sweep_seconds_{spacing:g}mm".replace(".", "_")
        found |= {name: (_seconds(there), "s")} if there else {}
    return found


def _seconds(rows: Sequence[Row]) -> float:
    return sum(sum(row.seconds.values()) for row in rows) / max(len(rows), 1)
