"""A file of curves that is edited: its muscles as the page shows them, saved, and made into tets."""

from __future__ import annotations

import json
import math
import shlex
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from handpipe.anatomy.editing import (
    CurveEditor,
    Draft,
    Edited,
    content_of,
    load_draft,
    place_on_bone,
    points_of,
    tendon_lines,
    write_curves,
)
from handpipe.anatomy.templates import Domain, TissueMesh, build_tissue_mesh
from handpipe.cli.muscle_curves.packing import pack
from handpipe.core import Array, InputError, evenly
from handpipe.core.configuration import Name, checked
from handpipe.fem.linear import factorise
from handpipe.mesh.surfaces import SURFACE_SUFFIXES, Surface, read_surface

TETS = 60_000  # of the domain, about, where no edge length is given
FIBRES = 1500  # lines of fibres that are drawn, at most


class CurveSession:
    """Muscles as curves between a skin and bones, as a person edits them.

    Parameters
    ----------
    target : Path
        File of the curves; it need not exist yet.
    skin : Surface
        Closed surface in mm.
    bones : mapping of str to Surface
        Closed surfaces in mm by bone.
    edge_length : float, optional
        Edge length of tets in mm.

    Raises
    ------
    InputError
        For a wrong file of curves, and for surfaces between which there are no tets.
    """

    def __init__(
        self, target: Path, skin: Surface, bones: Mapping[str, Surface], edge_length: float | None = None
    ) -> None:
        self.target, self.skin, self.bones = target, skin, bones
        self.draft = load_draft(target) if target.is_file() else Draft.model_validate({})
        self.kept: Path | None = None
        self.tissue: TissueMesh | None = None
        self.domain = Domain.between(skin, bones, edge_length or _edge_length(skin, bones))
        self._editor = CurveEditor(self.domain, skin, bones, factorise=factorise, source=target)
        self.edited = self._editor.edit(self.draft)

    def settings(self) -> dict[str, Any]:
        """What the page shows besides surfaces."""
        return {
            "title": self.target.stem,
            "file": str(self.target),
            "tets": len(self.domain.mesh.tets),
            "bones": list(self.bones),
        }

    def surfaces(self) -> bytes:
        """Skin and bones, packed."""
        named = {"skin": self.skin} | {f"bone/{name}": bone for name, bone in self.bones.items()}
        return pack({}, surface_arrays(named))

    def edit(self, content: bytes) -> bytes:
        """Take the whole content of the file as the page has it, and answer with its muscles, packed.

        Parameters
        ----------
        content : bytes
            JSON of a file of curves. A point may be a `drop` in mm with or without a `bone`: it is placed on
            the surface of that bone, or of the nearest one.

        Returns
        -------
        bytes
            Content without drops, places of points, faults, seconds; lines and surfaces.

        Raises
        ------
        InputError
            For content that is wrong; the session then stays as it was.
        """
        start = time.perf_counter()
        draft = checked(self.target, self._dropped(given_json(self.target, content)), Draft)
        self.edited, self.draft = self._editor.edit(draft), draft
        return self.state(time.perf_counter() - start)

    def state(self, seconds: float = 0.0) -> bytes:
        """The muscles as they are, packed; with the seconds that an edit took."""
        edited = self.edited
        lines: dict[str, NDArray] = {}
        for name, muscle in edited.muscles.items():
            lines |= {f"line/{name}/{i}": c.points.astype("f4") for i, c in enumerate(muscle.curves)}
        for name, points in tendon_lines(self.draft, self.bones, self.target).items():
            lines[f"tendon/{name}"] = points.astype("f4")
        surfaces = {f"muscle/{name}": surface for name, surface in edited.surfaces.items()}
        header = {
            "content": content_of(self.draft),
            "places": points_of(self.draft, self.bones, self.target),
            "faults": [f"{fault.field}: {fault.problem}. {fault.remedy}" for fault in edited.faults],
            "warnings": [*edited.warnings, *self._kept_parts()],
            "seconds": seconds,
        }
        return pack(header, lines | surface_arrays(surfaces))

    def _kept_parts(self) -> list[str]:
        """What the page says of a hand's parts that it does not edit."""
        parts = [kind for kind in ("ligaments", "tendons", "nails") if getattr(self.draft, kind)]
        return [f"{', '.join(parts)} of the file are kept as they are"] if parts else []

    def save(self) -> str:
        """Write the file; an earlier one is copied beside it once. Returns a sentence."""
        if self.kept is None and self.target.is_file() and self.draft.muscles:
            self.kept = copied_beside(self.target)
        write_curves(self.target, self.draft)
        kept = f"; the earlier file is {self.kept.name}" if self.kept else ""
        return f"saved {len(self.draft.muscles)} muscles to {self.target}{kept}"

    def make_tets(self) -> str:
        """Write the conforming mesh of all tissues beside the file. Returns a sentence.

        Raises
        ------
        InputError
            The first fault of the curves, and as `build_tissue_mesh` does.
        """
        require_faultless(self.edited)
        if not self.draft.muscles:
            raise InputError(self.target, "muscles", "there is none", "Draw a muscle first")
        tissue = build_tissue_mesh(
            self.draft.curves(), self.domain, self.bones, factorise=factorise, source=self.target
        )
        path = self.target.with_suffix(".h5")
        tissue.save(path)
        self.tissue = tissue
        volumes = dict(zip(tissue.names, tissue.volumes(), strict=True))
        said = ", ".join(f"{name} {volume / 1000:.1f} ml" for name, volume in volumes.items())
        warnings = "".join(f". {text}" for text in tissue.warnings)
        angle = f"smallest dihedral angle {tissue.mesh.smallest_dihedral():.1f} degrees"
        return f"{path}: {len(tissue.labels)} tets, {angle}; {said}{warnings}"

    def fibres(self) -> bytes:
        """Short lines along the fibres of some tets of the last mesh, packed."""
        if self.tissue is None:
            raise InputError(self.target, "tets", "have not been made", "Press Make tets")
        mesh, labels = self.tissue.mesh, self.tissue.labels
        muscle = np.flatnonzero(labels > 0)
        shown = muscle[evenly(len(muscle), FIBRES)]
        middles = mesh.vertices[mesh.tets[shown]].mean(axis=1)
        half = mesh.edge_length() * self.tissue.fibres[shown]
        return pack({}, {"lines": np.stack([middles - half, middles + half], axis=1).astype("f4")})

    def _dropped(self, content: Any) -> Any:
        """The content with each drop as a place on a bone."""

        def placed(given: Mapping[str, Any]) -> Any:
            point = given_vector(self.target, "drop", given["drop"])
            place = place_on_bone(point, self.bones, self.draft.distal, self.target, given.get("bone"))
            others = {key: value for key, value in given.items() if key not in ("drop", "bone")}
            return place.model_dump(mode="json", exclude_unset=True) | others

        return each_with("drop", content, placed)


def curves_command(file: Path, skin: Path, bones: Path) -> str:
    """The command that opens a file of curves, as a shell takes it.

    Parameters
    ----------
    file, skin, bones : Path
        File of the curves, surface of the skin, folder of the bones.

    Returns
    -------
    str
        One line; paths with blanks are quoted.
    """
    words = ["handpipe", "curves", str(file), "--skin", str(skin), "--bones", str(bones)]
    return shlex.join(words)


def copied_beside(path: Path) -> Path:
    """Copy a file before it is changed; the copy has the time in its name."""
    name = f"{path.stem}.before-{datetime.now():%Y%m%d-%H%M%S}{path.suffix}"
    return Path(shutil.copy2(path, path.with_name(name)))


def require_faultless(edited: Edited) -> None:
    """Raise the first fault of curves, if there is one."""
    if edited.faults:
        raise edited.faults[0]


def open_session(
    target: Path, skin: Path, bones: Sequence[Path], edge_length: float | None = None
) -> CurveSession:
    """The session of a file of curves between surfaces of files.

    Parameters
    ----------
    target : Path
        File of the curves; it need not exist yet.
    skin : Path
        Closed surface in mm: PLY, STL or OBJ.
    bones : sequence of Path
        Files of closed surfaces, or folders of them; a file's name is the bone's.
    edge_length : float, optional
        Edge length of tets in mm.

    Returns
    -------
    CurveSession

    Raises
    ------
    InputError
        For missing or wrong files.
    """
    require_yaml(target)
    files = [path for given in bones for path in _bone_files(given)]
    found: dict[str, Surface] = {}
    for path in files:
        if path.stem in found:
            raise InputError(path, "bone", f"{path.stem} stands twice", "Name each bone once")
        found[_bone_name(path)] = read_surface(path, closed=True)
    return CurveSession(target, read_surface(skin, closed=True), found, edge_length)


def require_yaml(target: Path) -> None:
    """Raise `InputError` for a name that is not of a YAML file."""
    if target.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(target, "file", "is no YAML file", "Name a file .yaml; it need not exist yet")


def given_json(target: Path, content: bytes) -> Any:
    """What a page sent as its content."""
    try:
        return json.loads(content)
    except ValueError as error:
        raise InputError(target, "edit", "is no JSON", "Load the page again") from error


def given_vector(target: Path, field: str, given: Any) -> Array:
    """Three finite numbers (3,) that a page sent."""
    try:
        vector = np.array(given, dtype=float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(target, field, f"{given} is no point", "Load the page again")
    return vector


def each_with(key: str, content: Any, replaced: Callable[[Mapping[str, Any]], Any]) -> Any:
    """JSON in which every object that has a key is replaced."""
    if isinstance(content, list):
        return [each_with(key, x, replaced) for x in content]
    if not isinstance(content, dict):
        return content
    if key in content:
        return replaced(content)
    return {name: each_with(key, value, replaced) for name, value in content.items()}


def _bone_files(given: Path) -> list[Path]:
    if not given.is_dir():
        return [given]
    found = sorted(p for p in given.iterdir() if p.suffix.lower() in SURFACE_SUFFIXES)
    if not found:
        raise InputError(given, "bones", "has no surface", f"Put files {', '.join(SURFACE_SUFFIXES)} there")
    return found


def _bone_name(path: Path) -> str:
    try:
        name: str = TypeAdapter(Name).validate_python(path.stem)
    except ValidationError as error:
        raise InputError(path, "bone", "is no name of a bone", "Use letters, digits and _") from error
    return name


def _edge_length(skin: Surface, bones: Mapping[str, Surface]) -> float:
    """Edge length in mm of the regular tets of which `TETS` fill the space."""
    volume = skin.volume() - sum(bone.volume() for bone in bones.values())
    return float(np.cbrt(6 * math.sqrt(2) * volume / TETS))


def surface_arrays(surfaces: Mapping[str, Surface]) -> dict[str, NDArray]:
    """Vertices and triangles of surfaces as a page gets them, by name."""
    vertices: dict[str, NDArray] = {
        f"{name}/vertices": s.vertices.astype("f4") for name, s in surfaces.items()
    }
    return vertices | {f"{name}/triangles": s.triangles.astype("u4") for name, s in surfaces.items()}
