"""The neutral skin: closed, remeshed, and which of its vertices are rigid."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, IntArray, artifacts
from handpipe.mesh.generation import genus, remesh, repair, without_handles
from handpipe.mesh.surfaces import Distance, Surface, component_labels

log = logging.getLogger(__name__)

CUT_END = "cut_end"
FARTHEST = 0.6  # of the skin's longest extent: cut vertices farther apart are at both ends of the limb


@dataclass(frozen=True)
class Rigid:
    """Skin vertices that move rigidly with a bone: a nail, or the cut end.

    Parameters
    ----------
    bone : str
        Name of the bone.
    vertices : array (k,)
        Ids of skin vertices.
    """

    bone: str
    vertices: IntArray


@dataclass(frozen=True)
class Skin:
    """The neutral skin and its rigid parts.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm.
    rigid : mapping of str to Rigid
        Nails and the cut end, by name.
    """

    surface: Surface
    rigid: Mapping[str, Rigid]

    def with_ends(self, bones: Mapping[str, Surface]) -> Skin:
        """The same skin; of a limb cut at both ends, each vertex there moves with its nearest bone.

        Parameters
        ----------
        bones : mapping of str to Surface
            Neutral bone surfaces in mm.

        Returns
        -------
        Skin
            This skin where the limb is cut once.
        """
        if CUT_END not in self.rigid:
            return self
        ends = self.rigid[CUT_END].vertices
        places = self.surface.vertices[ends]
        if (
            len(ends) == 0
            or np.ptp(places, axis=0).max() < FARTHEST * np.ptp(self.surface.vertices, axis=0).max()
        ):
            return self
        distances = np.array([Distance(bone).closest(places)[0] for bone in bones.values()])
        nearest = np.array([*bones])[distances.argmin(axis=0)]
        found = {name: part for name, part in self.rigid.items() if name != CUT_END}
        split = {f"{CUT_END}_{name}": Rigid(str(name), ends[nearest == name]) for name in np.unique(nearest)}
        return Skin(self.surface, found | split)

    def outside(self, points: Array) -> Array:
        """How far points lie outside of the skin, but for its rigid parts: a limb goes on beyond its cut.

        Parameters
        ----------
        points : array (n, 3)
            Neutral points in mm.

        Returns
        -------
        array (n,)
            Distances in mm, 0 inside.
        """
        signed, triangles, _, _ = Distance(self.surface).signed(points)
        rigid = np.concatenate([np.zeros(0, dtype=np.int64), *(p.vertices for p in self.rigid.values())])
        ends = np.isin(self.surface.triangles[triangles], rigid).all(axis=1)
        return np.where(ends, 0.0, np.maximum(signed, 0.0))

    def save(self, path: str | Path, inputs: Sequence[str | Path]) -> None:
        """Write as an artifact of kind "skin"."""
        data = {
            "vertices": self.surface.vertices,
            "triangles": self.surface.triangles,
            "rigid": {name: asdict(part) for name, part in self.rigid.items()},
        }
        artifacts.write(path, data, kind="skin", units={"vertices": "mm"}, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Skin:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            Where the file is of another kind.
        """
        d = artifacts.read(path, "skin")
        rigid = {name: Rigid(str(part["bone"]), part["vertices"]) for name, part in d["rigid"].items()}
        return Skin(Surface(d["vertices"], d["triangles"]), rigid)


def closed_skin(scan: Surface, edge: float) -> tuple[Surface, list[str]]:
    """The neutral skin as a closed surface, and what was repaired for it.

    Bridges between fingers that touched in the scanner are cut, with a warning that has their places.

    Parameters
    ----------
    scan : Surface
        Scan in mm.
    edge : float
        Edge length in mm.

    Returns
    -------
    skin : Surface
        Closed surface in mm.
    notes : list of str
        What was repaired.
    """
    closed, notes = repair(scan)
    if genus(closed):
        closed = _without_bridges(closed.largest_component(), 0.5 * edge)
    skin = remesh(closed, edge)
    parts = int(component_labels(skin.triangles).max()) + 1
    if parts > 1:
        skin = skin.largest_component()
        notes = [*notes, f"{parts - 1} small closed parts left out"]
    return skin, notes


def _without_bridges(closed: Surface, edge: float) -> Surface:
    """A scan without handles, cut with triangles of edges of about `edge` mm: a cut is four of them wide."""
    found, handles = without_handles(remesh(closed, edge))
    for handle in handles:
        log.warning(
            "neutral scan: %s Look at the skin there: the scanner may have joined two fingers", handle
        )
    if left := genus(found):
        text = "neutral scan: %d bridges between parts or holes through them are left: mend the scan"
        log.warning(text, left)
    return found
