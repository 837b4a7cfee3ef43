"""Muscles, fat and fibres from curves: the whole way from a file, a skin and bones to a mesh to simulate."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from handpipe.anatomy.improvement.cleaning import CRUMB, cleaned, label_parts
from handpipe.anatomy.improvement.improving import Labelled, improve
from handpipe.anatomy.templates.curves import CurveFile, PlacedMuscle, place
from handpipe.anatomy.templates.diffusion import Factorise, Functions, diffuse, superlu
from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.envelope import contenders, upper_envelope
from handpipe.anatomy.templates.fibres import fibres
from handpipe.anatomy.templates.volumes import meet_volumes
from handpipe.core import Array, InputError, IntArray, Metrics, artifacts
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import TetMesh, tet_neighbours

log = logging.getLogger(__name__)

KIND = "anatomy-template"
SNAP = 0.1  # share of an edge by which borders may move to vertices
SMALLEST_ANGLE = 10.0  # deg: least wanted dihedral angle


@dataclass(frozen=True, eq=False)
class TissueMesh:
    """One conforming mesh of fat and muscles between skin and bones.

    Parameters
    ----------
    mesh : TetMesh
        Tets in mm.
    labels : array (m,)
        Index of each tet's tissue in `names`.
    names : tuple of str
        Tissues, "fat" first.
    fibres : array (m, 3)
        Unit vectors, zero in fat.
    origins, insertions : dict of str to array (k,)
        Indices of vertices by muscle.
    skin : array (s,)
        Indices of the vertices on the skin: those of its surface in their order, then those of refined tets.
    bones : dict of str to array (b,)
        Indices of the vertices on each bone, in the same order.
    warnings : tuple of str
        What a person should know of the template, although it is no error.
    """

    mesh: TetMesh
    labels: IntArray
    names: tuple[str, ...]
    fibres: Array
    origins: dict[str, IntArray]
    insertions: dict[str, IntArray]
    skin: IntArray
    bones: dict[str, IntArray]
    warnings: tuple[str, ...] = field(default=())

    def part(self, name: str) -> tuple[TetMesh, IntArray]:
        """The tets of one tissue as a mesh of their own, and its vertices' numbers (n,) in the whole mesh."""
        return self.mesh.part(self.labels == self.names.index(name))

    def surface(self, name: str) -> Surface:
        """The closed surface of one tissue."""
        return self.part(name)[0].boundary().compact()

    def volumes(self) -> Array:
        """Volumes (k,) in mm^3 of the tissues."""
        sums = np.bincount(self.labels, self.mesh.volumes(), len(self.names))
        return np.asarray(sums, dtype=np.float64)

    def scaled(self, size: float) -> TissueMesh:
        """The mesh of the same shape that is `size` times as large about the origin."""
        return replace(self, mesh=TetMesh(size * self.mesh.vertices, self.mesh.tets))

    def metrics(self) -> Metrics:
        """Figures of the mesh that need no other knowledge."""
        return {
            "muscles": (len(self.names) - 1, ""),
            "bones": (len(self.bones), ""),
            "tets": (len(self.labels), ""),
            "inverted": (int((self.mesh.volumes() <= 0).sum()), ""),
            "smallest_dihedral": (self.mesh.smallest_dihedral(), "deg"),
            "manifold": (float(all(self.surface(name).is_closed() for name in self.names)), ""),
            **{
                f"volume_{name}": (float(v), "mm^3")
                for name, v in zip(self.names, self.volumes(), strict=True)
            },
        }

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the artifact."""
        artifacts.write(
            path,
            {
                "vertices": self.mesh.vertices,
                "tets": self.mesh.tets,
                "labels": self.labels,
                "names": list(self.names),
                "fibres": self.fibres,
                "origins": self.origins,
                "insertions": self.insertions,
                "skin": self.skin,
                "bones": self.bones,
                "warnings": list(self.warnings),
            },
            kind=KIND,
            units={"vertices": "mm"},
            inputs=inputs,
        )

    @staticmethod
    def load(path: str | Path) -> TissueMesh:
        """Read what `save` wrote."""
        data = artifacts.read(path, KIND)
        return TissueMesh(
            TetMesh(data["vertices"], data["tets"]).checked(path),
            data["labels"],
            tuple(str(n) for n in data["names"]),
            data["fibres"],
            data["origins"],
            data["insertions"],
            data["skin"],
            data["bones"],
            tuple(str(w) for w in data["warnings"]),
        )


def build_tissue_mesh(
    file: CurveFile,
    domain: Domain,
    bones: Mapping[str, Surface],
    *,
    factorise: Factorise = superlu,
    source: str | Path = "curves",
) -> TissueMesh:
    """Fill the space between skin and bones with the muscles of a file, and fat.

    The triangles of skin and bones are cut where muscles end on them, and kept otherwise.

    Parameters
    ----------
    file : CurveFile
        Muscles as curves, and the fat.
    domain : Domain
        Tets between skin and bones; they are refined along muscles that ask for it.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    factorise : callable
        Factors symmetric positive definite matrices, see `superlu`.
    source : path
        The file, for messages.

    Returns
    -------
    TissueMesh
        Its `warnings`, which the log has too, name doubtful muscles.

    Raises
    ------
    InputError
        For curves that do not fit.
    ConvergenceError
        For volumes of muscles that the mesh cannot meet.
    """
    muscles = place(file, bones, domain.edge_length() / 4, source)
    warnings = crossings(muscles, domain.edge_length())
    fine = [(c.points, m.edge_length) for m in muscles.values() if m.edge_length for c in m.curves]
    if fine:
        lengths = np.concatenate([np.full(len(points), length) for points, length in fine])
        domain = domain.refined(np.concatenate([points for points, _ in fine]), lengths)
    functions = diffuse(domain, muscles, file.fat, factorise=factorise)
    labelled = _of_volumes(domain, functions, muscles)
    warnings += _parts(labelled, functions.names, source)
    for text in warnings:
        log.warning(text)
    directions = np.zeros((len(labelled.labels), 3))
    origins, insertions = {}, {}
    for label, (name, muscle) in enumerate(muscles.items(), start=1):
        own = labelled.labels == label
        part, used = labelled.mesh.part(own)
        found = fibres(part, muscle, factorise=factorise, source=f"{source}: muscles.{name}")
        directions[own] = found.directions
        origins[name], insertions[name] = used[found.origin], used[found.insertion]
    return TissueMesh(
        labelled.mesh,
        labelled.labels,
        functions.names,
        directions,
        origins,
        insertions,
        *numbered_surfaces(domain),
        tuple(warnings),
    )


def segment(
    domain: Domain,
    values: Array,
    *,
    snap: float = SNAP,
    angle: float = SMALLEST_ANGLE,
    crumb: float = CRUMB,
) -> Labelled:
    """The mesh cut by the largest of functions (n, k), with smooth borders and tets of good quality.

    Skin and bones come first in it, as `numbered_surfaces` says. Parts of a label below the share `crumb` of
    its largest part go to the labels around them.
    """
    envelope = upper_envelope(domain.mesh, contenders(domain.mesh.tets, values), snap=snap)
    labels = cleaned(envelope.mesh, envelope.labels, crumb)
    fixed = np.concatenate([domain.skin, *domain.bones.values()])
    return improve(Labelled(envelope.mesh, labels), fixed, target=angle)


def numbered_surfaces(domain: Domain) -> tuple[IntArray, dict[str, IntArray]]:
    """The vertices on skin and bones once they come first in the mesh, as `segment` has them."""
    ends = np.cumsum([len(domain.skin), *(len(v) for v in domain.bones.values())])
    bones = {name: np.arange(a, b) for name, a, b in zip(domain.bones, ends[:-1], ends[1:], strict=True)}
    return np.arange(ends[0]), bones


def _of_volumes(domain: Domain, functions: Functions, muscles: Mapping[str, PlacedMuscle]) -> Labelled:
    """The mesh cut by functions that are scaled so that muscles get the requested volumes."""
    targets = np.array([np.nan, *(m.volume or np.nan for m in muscles.values())])
    if not np.isfinite(targets).any():
        return segment(domain, functions.values)
    last: list[Labelled] = []

    def volumes_of(scales: Array) -> Array:
        last[:] = [segment(domain, functions.values * scales)]
        sums = np.bincount(last[0].labels, last[0].mesh.volumes(), len(targets))
        return np.asarray(sums, dtype=np.float64)

    meet_volumes(targets, volumes_of, functions.names)
    return last[0]


def crossings(muscles: Mapping[str, PlacedMuscle], reach: float) -> list[str]:
    """Sentences on pairs of muscles whose curves come nearer than half an edge away from their ends."""
    names = list(muscles)
    points = [np.concatenate([c.points for c in muscles[name].curves]) for name in names]
    said = []
    for i, first in enumerate(names):
        tree = cKDTree(points[i])
        for j in range(i):
            distance, _ = tree.query(points[j])
            if distance.min() < reach / 2:
                place = ", ".join(f"{c:.1f}" for c in points[j][np.argmin(distance)])
                said.append(
                    f"{first} and {names[j]}: their curves come within {distance.min():.2g} mm near "
                    f"({place}); each may be cut in two there: lead one past the other"
                )
    return said


def _parts(labelled: Labelled, names: Sequence[str], source: str | Path) -> list[str]:
    """Sentences on muscles that are in several parts; `InputError` for a muscle that is nowhere."""
    part = label_parts(labelled.labels, tet_neighbours(labelled.mesh.tets))
    said = []
    for label, name in enumerate(names[1:], start=1):
        count = len(np.unique(part[labelled.labels == label]))
        if count == 0:
            problem = "is nowhere the largest tissue"
            raise InputError(source, f"muscles.{name}", problem, "Raise `tissue`, or choose shorter edges")
        if count > 1:
            said.append(f"{name}: is in {count} parts")
    return said
