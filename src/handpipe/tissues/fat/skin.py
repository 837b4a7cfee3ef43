"""The neutral skin: closed, remeshed, and which of its vertices are rigid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from handpipe.core import IntArray, artifacts
from handpipe.mesh.generation import remesh, repair
from handpipe.mesh.surfaces import Distance, Surface

CUT_END = "cut_end"
LARGE = 0.2  # of the largest part of the cut end: smaller ones are mended holes


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
        """The same skin; of a cut end in several large parts, each moves with the bone nearest to it.

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
        parts = _parts(self.surface, self.rigid[CUT_END].vertices)
        large = [part for part in parts if len(part) > LARGE * max(map(len, parts))]
        if len(large) < 2:
            return self
        found = {name: part for name, part in self.rigid.items() if name != CUT_END}
        for number, part in enumerate(large, 1):
            middle = self.surface.vertices[part].mean(axis=0)[None]
            distance = {name: float(Distance(bone).closest(middle)[0][0]) for name, bone in bones.items()}
            found[f"{CUT_END}{number}"] = Rigid(min(distance, key=distance.__getitem__), part)
        return Skin(self.surface, found)

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


def _parts(surface: Surface, vertices: IntArray) -> list[IntArray]:
    """The vertices (k,) in parts that edges join."""
    edges = surface.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = edges[np.isin(edges, vertices).all(axis=1)]
    count = len(surface.vertices)
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (count, count))
    label = connected_components(graph, directed=False)[1][vertices]
    return [vertices[label == number] for number in np.unique(label)]


def closed_skin(scan: Surface, edge: float) -> tuple[Surface, list[str]]:
    """The neutral skin as a closed surface, and what was repaired for it.

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
    return remesh(closed, edge), notes
