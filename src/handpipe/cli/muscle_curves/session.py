"""A file of curves that is edited: its muscles as the page shows them, saved, and made into tets."""

from __future__ import annotations

import json
import math
import shlex
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from handpipe.anatomy.bending import BentLimb, ProposedJoint, propose_joints
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
from handpipe.cli.muscle_curves.asked_pose import AskedPose, asked_pose
from handpipe.cli.muscle_curves.given import each_with, given_json, given_vector
from handpipe.cli.muscle_curves.packing import pack
from handpipe.cli.muscle_curves.pose_run import PoseRun, Solve
from handpipe.cli.own_files import written_anew
from handpipe.core import InputError, evenly, write_text
from handpipe.core.configuration import Name, checked
from handpipe.fem.elements import Material
from handpipe.fem.linear import factorise
from handpipe.mesh.files import SURFACE_SUFFIXES, read_surface, write_surface
from handpipe.mesh.surfaces import Surface
from handpipe.shapes.optimisation import MUSCLE
from handpipe.tissues.fat import TissueSettings
from handpipe.tissues.ligaments import LIGAMENT

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
        self._made_of: Draft | None = None  # curves of which the tissue was made
        self._run: PoseRun | None = None
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
        edited = self._editor.edit(draft)
        if draft != self.draft:
            self.back_to_rest()
        self.edited, self.draft = edited, draft
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
        self.back_to_rest()
        require_faultless(self.edited)
        if not self.draft.muscles:
            raise InputError(self.target, "muscles", "there is none", "Draw a muscle first")
        tissue = build_tissue_mesh(
            self.draft.curves(), self.domain, self.bones, factorise=factorise, source=self.target
        )
        path = self.target.with_suffix(".h5")
        tissue.save(path)
        self.tissue, self._made_of = tissue, self.draft
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

    def joints(self) -> dict[str, Any]:
        """What the page shows of each joint, by the bone that moves: first where most bones move."""
        joints = sorted(self._joints().items(), key=lambda item: -len(item[1].moving))
        return {
            bone: {
                "parent": joint.parent,
                "moving": list(joint.moving),
                "centre": joint.centre.round(1).tolist(),
                "axes": {name: axis.tolist() for name, axis in joint.axes.items()},
            }
            for bone, joint in joints
        }

    def start_pose(self, content: bytes) -> str:
        """Begin to solve a pose of the last tets, in a process of its own. Returns a sentence.

        Parameters
        ----------
        content : bytes
            JSON as `asked_pose` reads it.

        Raises
        ------
        InputError
            For a wrong field, and where there are no tets of these curves.
        """
        if self.tissue is None or self._made_of != self.draft:
            problem = "there are no tets of these curves"
            raise InputError(self.target, "pose", problem, "Press Make tets, then simulate")
        tissue = self.tissue
        asked = asked_pose(self.target, content, self._joints(), tissue.names[1:])
        self.back_to_rest()
        solve = Solve(tissue, self.bones, self._materials(tissue), asked)
        self._run = PoseRun(solve, lambda limb: self._write_pose(tissue, asked, limb))
        return f"Simulating {len(tissue.labels)} tets in {asked.bend.steps} steps"

    def pose_state(self) -> dict[str, Any]:
        """What `PoseRun.state` says of the last solve; `state` is "rest" if there is none."""
        run = self._run
        return {"state": "rest"} if run is None else run.state()

    def posed(self) -> bytes:
        """Skin, bones and muscles in the simulated pose, packed.

        Raises
        ------
        InputError
            Where there is none.
        """
        run = self._run
        if run is None or run.limb is None or self.tissue is None:
            raise InputError(self.target, "pose", "has not been simulated", "Press Simulate")
        return pack({}, surface_arrays(self._posed_surfaces(self.tissue, run.limb)))

    def back_to_rest(self) -> str:
        """Discard the pose, and end its solve. Returns a sentence."""
        run, self._run = self._run, None
        if run is not None:
            run.stop()
        return "At rest"

    def _joints(self) -> dict[str, ProposedJoint]:
        return propose_joints(self.bones, np.array(self.draft.distal))

    def _materials(self, tissue: TissueMesh) -> dict[str, Material]:
        """The layers' materials (Zheng 2022 Table 2), of each tissue."""
        fat = TissueSettings()
        organs = {n: LIGAMENT if n in self.draft.ligaments else MUSCLE for n in tissue.names[1:]}
        return {tissue.names[0]: Material(fat.young, fat.poisson), **organs}

    def _posed_surfaces(self, tissue: TissueMesh, limb: BentLimb) -> dict[str, Surface]:
        """Skin, `bone/NAME` and `muscle/NAME` in a pose.

        The skin's given vertices are the mesh's first ones.
        """
        moved = replace(tissue, mesh=limb.mesh)
        found = {"skin": self.skin.moved(limb.mesh.vertices[: len(self.skin.vertices)])}
        found |= {f"bone/{n}": b.moved(limb.bones[n](b.vertices)) for n, b in self.bones.items()}
        return found | {f"muscle/{name}": moved.surface(name) for name in tissue.names[1:]}

    def _write_pose(self, tissue: TissueMesh, asked: AskedPose, limb: BentLimb) -> str:
        """Write the surfaces and what was simulated in a folder beside the file. Returns a sentence."""
        folder = self.target.with_name(f"{self.target.stem}-pose-{asked.name}")
        bend = asked.bend
        figures = {
            "moving": list(bend.moving),
            "centre_mm": bend.centre.tolist(),
            "axis": bend.axis.tolist(),
            "angle_deg": math.degrees(bend.angle),
            "shortening": dict(bend.shortening),
            "tets": len(tissue.labels),
            "residual_mN": limb.residual,
            "notes": list(limb.notes),
        }
        with written_anew(folder, "handpipe curves") as made:
            for name, surface in self._posed_surfaces(tissue, limb).items():
                path = made / f"{name}.ply"
                path.parent.mkdir(exist_ok=True)
                write_surface(path, surface)
            write_text(made / "pose.json", json.dumps(figures, indent=1) + "\n")
        notes = "".join(f". {note[0].upper()}{note[1:]}" for note in limb.notes)
        solved = f"Simulated in {bend.steps} steps, residual {limb.residual:.1e} mN"
        return f"{solved}. Skin, bones and muscles are in {folder}{notes}"

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
