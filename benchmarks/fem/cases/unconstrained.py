"""Bodies that nothing holds, alone and beside others."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from benchmarks.fem import scenes
from benchmarks.fem.cases.outcome import ONE_STEP, YOUNG, Outcome, case, largest, without_rigid_motion
from benchmarks.fem.scenes import Body
from handpipe.fem.elements import Material
from handpipe.fem.linear.nullspace import rigid_pins
from handpipe.fem.potentials import Elastic, Pull
from handpipe.fem.solver import solve


def traction(body: Body, length: float, kilopascal: float) -> Pull:
    """Pulls both ends, across x, of a box of this length apart."""
    areas = np.zeros(len(body.vertices))
    corners = body.vertices[body.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    at_end = (np.abs(np.abs(corners[:, :, 0]) - length / 2) < 1e-9).all(axis=1)
    np.add.at(areas, body.triangles[at_end], area[at_end, None] / 3)
    forces = np.zeros_like(body.vertices)
    forces[:, 0] = kilopascal * areas * np.sign(body.vertices[:, 0])
    return Pull(sp.eye(len(body.vertices), format="csr"), forces)


@case("unattached", "a free bar pulled at both ends, at once")
def unattached(refine: int) -> Outcome:
    body = scenes.box((3.0, 1.0, 1.0), (9 * refine, 3 * refine, 3 * refine))
    x, material = body.vertices, Material(YOUNG, 0.45)
    elastic, pull = Elastic(x, body.tets, material), traction(body, 3.0, 5.0)
    fixed = np.zeros(x.size, dtype=bool)
    fixed[rigid_pins(x)] = True
    found = solve([elastic, pull], x, fixed=fixed, options=ONE_STEP)
    error = without_rigid_motion(found.x, x * scenes.uniaxial(material, 5.0))
    answer = "uniaxial stress but for a rigid motion"
    return Outcome(x, found.x, found.record, elastic, body.triangles, ~fixed, [elastic, pull], error, answer)


@case("two-bodies", "a twisted beam and a free bar pulled at both ends, in one system")
def two_bodies(refine: int) -> Outcome:
    bar = scenes.box((3.0, 1.0, 1.0), (6 * refine, 2 * refine, 2 * refine))
    count, aside = len(bar.vertices), np.array([0.0, 3.0, 0.0])
    x = np.concatenate([bar.vertices, bar.vertices + aside])
    tets = np.concatenate([bar.tets, bar.tets + count])
    triangles = np.concatenate([bar.triangles, bar.triangles + count])
    material = Material(YOUNG, 0.45)
    elastic, single = Elastic(x, tets, material), Elastic(bar.vertices, bar.tets, material)
    second = sp.eye(2 * count, format="csr")[count:]
    pull = Pull(second, -traction(bar, 3.0, 5.0).gradient(bar.vertices))
    clamped = np.repeat(bar.where(0, -1.5) | bar.where(0, 1.5), 3)
    fixed = np.concatenate([clamped, np.zeros(3 * count, dtype=bool)])
    fixed[3 * count + rigid_pins(bar.vertices)] = True
    twisted = scenes.turned(bar.vertices, bar.where(0, 1.5), (1, 0, 0), 60.0)
    start = np.concatenate([twisted, bar.vertices + aside])
    found = solve([elastic, pull], start, fixed=fixed, options=ONE_STEP)
    alone = solve([single], twisted, fixed=clamped, options=ONE_STEP).x
    stretched = bar.vertices * scenes.uniaxial(material, 5.0)
    error = max(largest(found.x[:count] - alone), without_rigid_motion(found.x[count:], stretched))
    answer = "each alone"
    return Outcome(start, found.x, found.record, elastic, triangles, ~fixed, [elastic, pull], error, answer)
