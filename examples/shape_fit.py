"""Shape of an organ from marks.

A ball is deformed to 200 marks on the surface of an ellipsoid. The fit finds the plastic strains whose
equilibrium meets the marks.
"""

import numpy as np
import trimesh

from handpipe.mesh.generation import tetrahedralise
from handpipe.mesh.surfaces import Surface
from handpipe.shapes.organs import Observed, fit_organ

AXES = np.array([7.0, 5.0, 4.0])  # mm

ball = trimesh.creation.icosphere(subdivisions=2, radius=5.0)
template = tetrahedralise(Surface(np.array(ball.vertices), np.array(ball.faces, dtype=np.int64)), 2.5)
marks = trimesh.creation.icosphere(subdivisions=3).vertices[::3] * AXES

fit = fit_organ(template, Observed(marks))
size = np.ptp(fit.mesh.vertices, axis=0)
print("size of the organ", size.round(2), "mm; of the ellipsoid", 2 * AXES, "mm")
assert np.allclose(size, 2 * AXES, rtol=0.05)
