"""The neutral skin: closed, remeshed, and which of its vertices are rigid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from handpipe.core import IntArray, artifacts
from handpipe.mesh.generation import remesh, repair
from handpipe.mesh.surfaces import Surface


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
