"""Wrong input: angles, frames and artifacts that no result may be made of."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, MutableMapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.layered.case import Case, Outcome, Solved
from benchmarks.layered.subject import PLAIN, Subject
from handpipe.core import RigidTransform, artifacts
from handpipe.skeleton.joints.angles import read_angles

FAR = 2.5  # times the limits
Damage = Callable[[MutableMapping[str, Any]], None]


def _table(cell: str) -> Callable[[Subject], Outcome]:
    """A table of angles with a cell in the first angle's column."""

    def run(subject: Subject) -> Outcome:
        first = next(iter(subject.limits))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "frames.csv"
            path.write_text(f"frame,{first} [deg]\ncase,{cell}\n", encoding="utf-8")
            frames = read_angles(path, subject.limits)
        return Outcome([Solved.of(subject.frame("case", frames["case"]), subject.whole())], same_pose=False)

    return run


def _far(subject: Subject) -> Outcome:
    """Beyond the limits from Python, where nothing compares with them: bones run into one another."""
    frame = subject.frame("case", subject.bent(FAR))
    return Outcome([Solved.of(frame, subject.whole())], same_pose=False)


def _nan(subject: Subject) -> Outcome:
    """An angle that is not a number, from Python."""
    last = list(subject.limits)[-1]
    frame = subject.frame("case", subject.bent(PLAIN) | {last: float("nan")})
    return Outcome([Solved.of(frame, subject.whole())])


def _scaling(subject: Subject) -> Outcome:
    """A bone's transform with a matrix that is no rotation."""
    last = list(subject.bones)[-1]
    wrong = RigidTransform.identity()
    object.__setattr__(wrong, "rotation", 1.2 * np.eye(3))
    frame = replace(subject.plain, bones=dict(subject.plain.bones) | {last: wrong})
    return Outcome([Solved.of(frame, subject.whole())])


def _absent(subject: Subject) -> Outcome:
    """A frame without the last bone."""
    last = list(subject.bones)[-1]
    bones = {n: t for n, t in subject.plain.bones.items() if n != last}
    return Outcome([Solved.of(replace(subject.plain, bones=bones), subject.whole())])


def _damaged(layer: str, kind: str, damage: Damage, at: int = 0) -> Callable[[Subject], Outcome]:
    """A layer whose artifact was damaged before it was written: its hash is right."""

    def run(subject: Subject) -> Outcome:
        with tempfile.TemporaryDirectory() as folder:
            files = list(subject.files[layer])
            data = artifacts.read(files[at], kind)
            damage(data)
            files[at] = Path(folder) / "damaged.h5"
            artifacts.write(files[at], data, kind=kind)
            changed = subject.load(layer, files)
        return Outcome([Solved.of(subject.plain, subject.whole(**{layer: changed}))])

    return run


def _broken(change: Callable[[bytes], bytes]) -> Callable[[Subject], Outcome]:
    """The fat's mesh from a file with other bytes."""

    def run(subject: Subject) -> Outcome:
        with tempfile.TemporaryDirectory() as folder:
            files = list(subject.files["fat"])
            path = Path(folder) / "broken.h5"
            path.write_bytes(change(files[0].read_bytes()))
            changed = subject.load("fat", [path, *files[1:]])
        return Outcome([Solved.of(subject.plain, subject.whole(fat=changed))])

    return run


def _turned(tets: np.ndarray) -> None:
    """The first tet with two vertices exchanged: it is inside out."""
    tets[0, :2] = tets[0, 1::-1].copy()


def _beyond(cells: np.ndarray) -> None:
    """The last cell with a vertex that does not exist."""
    cells[-1, -1] = 10**6


def _at(*path: str) -> Callable[[MutableMapping[str, Any]], Any]:
    def find(data: MutableMapping[str, Any]) -> Any:
        for name in path:
            data = data[name]
        return data

    return find


def _on(find: Callable[[MutableMapping[str, Any]], Any], change: Callable[[Any], None]) -> Damage:
    return lambda data: change(find(data))


def _not_a_number(values: np.ndarray) -> None:
    values.ravel()[-1] = np.nan


def _shorter(*path: str) -> Damage:
    """Without the last tet's strains: those of another mesh."""

    def damage(data: MutableMapping[str, Any]) -> None:
        group = _at(*path[:-1])(data)
        group[path[-1]] = group[path[-1]][:, :-1]

    return damage


def _flipped(content: bytes) -> bytes:
    middle = 2 * len(content) // 3
    return content[:middle] + bytes(b ^ 255 for b in content[middle : middle + 64]) + content[middle + 64 :]


def _damage(name: str, what: str, layer: str, kind: str, damage: Damage, at: int = 0) -> Case:
    return Case(name, f"plain, {what}", _damaged(layer, kind, damage, at), named="damaged.h5")


CASES = [
    Case("beyond-limits", "an angle of 200 deg in a table", _table("200"), named="outside its limits"),
    Case("nan-table", "an angle `nan` in a table", _table("nan"), named="finite"),
    Case("far-outside", "all flexions at 2.5 times their limits, from Python", _far, named=""),
    Case("nan-frame", "an angle NaN, from Python", _nan, named="finite"),
    Case("scaled-bone", "a bone's transform with a matrix that scales by 1.2", _scaling, named="rotation"),
    Case("absent-bone", "a frame without a bone", _absent, named="bone"),
    _damage("fat-turned", "a tet of the fat with two vertices exchanged", "fat", "tissue",
            _on(_at("mesh", "tets"), _turned)),
    _damage("fat-no-vertex", "a tet of the fat with a vertex that is missing", "fat", "tissue",
            _on(_at("mesh", "tets"), _beyond)),
    _damage("fat-skin", "a triangle of the skin with a vertex that is missing", "fat", "tissue",
            _on(_at("skin", "triangles"), _beyond)),
    _damage("fat-weights", "a bone's weight in the fat that is NaN", "fat", "tissue",
            _on(_at("weights"), _not_a_number)),
    _damage("strains-nan", "a plastic strain of the fat that is NaN", "fat", "fat_strains",
            _on(_at("log_strains"), _not_a_number), at=1),
    _damage("strains-other", "plastic strains of another mesh of the fat", "fat", "fat_strains",
            _shorter("log_strains"), at=1),
    _damage("muscle-turned", "a tet of a muscle with two vertices exchanged", "muscles", "muscle",
            _on(_at("body", "mesh", "tets"), _turned)),
    _damage("muscle-no-vertex", "a tet of a muscle with a vertex that is missing", "muscles", "muscle",
            _on(_at("body", "mesh", "tets"), _beyond)),
    _damage("muscle-nan", "a plastic strain of a muscle that is NaN", "muscles", "muscle",
            _on(_at("logs"), _not_a_number)),
    _damage("muscle-other", "plastic strains of another mesh of a muscle", "muscles", "muscle",
            _shorter("logs")),
    _damage("ligament-turned", "a tet of a ligament with two vertices exchanged", "ligaments", "muscle",
            _on(_at("body", "mesh", "tets"), _turned)),
    _damage("fascia-no-vertex", "a triangle of a fascia with a vertex that is missing", "bone_fascia",
            "fascia", _on(_at("surface", "triangles"), _beyond)),
    _damage("fascia-nan", "a vertex of a fascia that is NaN", "bone_fascia", "fascia",
            _on(_at("surface", "vertices"), _not_a_number)),
    _damage("tendon-nan", "a vertex of a tendon that is NaN", "tendons", "tendon",
            _on(_at("rod", "x"), _not_a_number)),
    _damage("hooks-nan", "a hook of a tendon that is NaN", "tendons", "tendon",
            _on(_at("hooks", "corrections"), _not_a_number)),
    Case("truncated", "the file of the fat ends early", _broken(lambda b: b[: len(b) // 2]),
         named="broken.h5"),
    Case("flipped", "64 bytes of the file of the fat are changed", _broken(_flipped), named="broken.h5"),
]  # fmt: skip
