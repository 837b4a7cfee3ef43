"""Stretch of a hanging bar.

A bar hangs from its upper end under its own weight. The solver finds the static equilibrium. For small loads
its length change is weight * length / (2 * area * Young's modulus).
"""

import numpy as np
import scipy.sparse as sp
import skfem

from handpipe.fem.elements import Material
from handpipe.fem.potentials import Elastic, Pull
from handpipe.fem.solver import Options, solve

LENGTH, YOUNG, WEIGHT = 20.0, 10.0, 0.5  # mm, kPa, mN

mesh = skfem.MeshTet.init_tensor(np.linspace(0, 2, 3), np.linspace(0, 2, 3), np.linspace(0, LENGTH, 21))
vertices, tets = mesh.p.T.copy(), mesh.t.T.astype(np.int64)
corners = vertices[tets]
inverted = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
tets[inverted] = tets[inverted][:, [0, 1, 3, 2]]

share = np.zeros(len(vertices))
volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
np.add.at(share, tets, volumes[:, None] / 4 / volumes.sum())
weight = Pull(sp.eye(len(vertices), format="csr"), -WEIGHT * share[:, None] * np.array([0.0, 0.0, 1.0]))

body = Elastic(vertices, tets, Material(young=YOUNG, poisson=0.0))
top = np.repeat(vertices[:, 2] == LENGTH, 3)
found = solve([body, weight], vertices, fixed=top, options=Options(name="hanging bar"))

stretch = -(found.x - vertices)[vertices[:, 2] == 0, 2].mean()
expected = WEIGHT * LENGTH / (2 * 4.0 * YOUNG)
print(f"the bar is {stretch:.4f} mm longer; the linear theory gives {expected:.4f} mm")
assert abs(stretch - expected) < 0.02 * expected
