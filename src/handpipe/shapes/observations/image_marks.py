"""Marks found in an image along the normals of the current surface, in every step."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array
from handpipe.imaging.evidence import MarkerSettings, boundary_markers
from handpipe.imaging.volumes import Volume
from handpipe.mesh.tets import TetMesh
from handpipe.shapes.observations.correspondence import Correspondence, Markers


class ImageMarks:
    """Edges of the image near the boundary of a body, with a confidence each.

    An edge corresponds to the vertex from which it was searched. Where the image shows no edge there is none.
    """

    def __init__(
        self, mesh: TetMesh, volume: Volume, tangential: float, settings: MarkerSettings | None = None
    ) -> None:
        self.mesh, self.volume, self.tangential, self.settings = mesh, volume, tangential, settings
        ids = mesh.boundary_vertices()
        shape = (len(ids), len(mesh.vertices))
        self._outer = sparse.csr_matrix((np.ones(len(ids)), ids, np.arange(len(ids) + 1)), shape=shape)
        self._surface = mesh.boundary().compact()

    def level(self, x: Array) -> float:
        """The organ's intensity: the median at the centres of its tets, weighted by their volumes."""
        present = self.mesh.moved(x)
        values = self.volume.sample(x[self.mesh.tets].mean(axis=1))
        order = np.argsort(values)
        below = np.cumsum(np.abs(present.volumes())[order])
        return float(values[order[np.searchsorted(below, 0.5 * below[-1])]])

    def __call__(self, x: Array) -> Correspondence:
        """The edges near the current surface, at vertices x (n, 3)."""
        present = self._surface.moved(self._outer @ x)
        found = boundary_markers(self.volume, present, self.settings, muscle_level=self.level(x))
        markers = Markers(found.points, found.confidence, found.vertices)
        return Correspondence.match(markers, present, self._outer, self.tangential)
