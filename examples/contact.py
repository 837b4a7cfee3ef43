"""A block on a plane.

Gravity pulls a block onto a plane with one-sided contact. The block may not sink below the plane by more than
the stiffness of the contact allows, and the contact carries the whole weight.
"""

import numpy as np
import scipy.sparse as sp
import skfem

from handpipe.fem.contact import Contact
from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic, Pull
from handpipe.fem.solver import Options, solve

WEIGHT = 2.0  # mN

mesh = skfem.MeshTet.init_tensor(*[np.linspace(0, 4, 5)] * 3)
vertices, tets = mesh.p.T.copy(), mesh.t.T.astype(np.int64)
corners = vertices[tets]
inverted = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
tets[inverted] = tets[inverted][:, [0, 1, 3, 2]]

points = sp.eye(len(vertices), format="csr")
body = Elastic(vertices, tets, Material(young=6.0, poisson=0.45))
weight = Pull(points, np.tile([0.0, 0.0, -WEIGHT / len(vertices)], (len(vertices), 1)))
lowest = vertices[:, 2] == 0
up = np.tile([0.0, 0.0, 1.0], (lowest.sum(), 1))
plane = Contact(points[lowest], vertices[lowest] * [1, 1, 0], up, stiffness=100.0)

# The plane does not hold the block sideways.
sideways = np.zeros((len(vertices), 3), dtype=bool)
sideways[np.flatnonzero(lowest)[0], :2] = True
sideways[np.flatnonzero(lowest)[-1], 0] = True
found = solve([body, weight, plane], vertices, fixed=sideways.ravel(), options=Options(name="block"))

carried = plane.gradient(found.x)[:, 2].sum()
print(f"the plane carries {-carried:.3f} mN of {WEIGHT} mN; the block sinks by {-found.x[:, 2].min():.4f} mm")
assert abs(-carried - WEIGHT) < 1e-3 * WEIGHT
assert found.x[:, 2].min() > -0.05
