"""Growth by plastic strain.

A free block gets the same plastic strain in each tet. Its equilibrium has no stress: each edge grows by the
exponential of the log-strain. The solver pins the rigid-body modes.
"""

import numpy as np
import skfem

from handpipe.fem.elements import Material, plasticity
from handpipe.fem.potentials import Elastic
from handpipe.fem.solver import Options, solve

LOG_STRAIN = np.array([0.3, 0.0, 0.0, -0.1, 0.0, 0.0])  # xx, xy, xz, yy, yz, zz

mesh = skfem.MeshTet.init_tensor(*[np.linspace(0, 4, 4)] * 3)
vertices, tets = mesh.p.T.copy(), mesh.t.T.astype(np.int64)
corners = vertices[tets]
inverted = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
tets[inverted] = tets[inverted][:, [0, 1, 3, 2]]

body = Elastic(vertices, tets, Material(young=6.0, poisson=0.45))
grown = body.with_strains(plasticity.exp(np.tile(LOG_STRAIN, (len(tets), 1))))
found = solve([grown], vertices, options=Options(name="growing block"))

# The block may also turn: compare lengths of its edges.
origin = np.flatnonzero((vertices == 0).all(axis=1))[0]
ends = [np.flatnonzero((vertices == 4 * axis).all(axis=1))[0] for axis in np.eye(3)]
size = np.linalg.norm(found.x[ends] - found.x[origin], axis=1)
expected = 4 * np.exp(LOG_STRAIN[[0, 3, 5]])
print("size", size.round(4), "expected", expected.round(4))
assert np.allclose(size, expected, atol=1e-4)
