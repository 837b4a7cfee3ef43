"""A part cut out of a body: it stays where the whole has it."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.truth import toy

from handpipe.fem.solver.equilibrium import Options, solve
from handpipe.synthetic.coupled.coupled_body import CoupledBody, CoupledPose
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.submodel import CUT, cut_out, refinement_error
from handpipe.synthetic.coupled.validation import difference, solved_from

OPTIONS = Options(displacement_tolerance=1e-8, force_tolerance=1e-9)
ANGLE = np.radians(20.0)


@pytest.fixture(scope="module")
def whole():
    return CoupledBody(replace(toy.finger(6.5), strands={}), toy.MATERIALS, order=1)


@pytest.fixture(scope="module")
def posed(whole):
    return follow(whole, lambda t: toy.hinge(ANGLE * t), options=OPTIONS).x


@pytest.fixture(scope="module")
def chosen(whole):
    mesh = whole.anatomy.mesh
    return mesh.vertices[mesh.tets].mean(axis=1)[:, 0] > 4.0


def test_a_part_is_in_equilibrium_where_the_whole_is(whole, posed, chosen):
    anatomy, used = cut_out(whole.anatomy, chosen)
    part = CoupledBody(anatomy, toy.MATERIALS, order=1)
    assert part.elements.volumes.sum() == pytest.approx(whole.elements.volumes[chosen].sum())
    held = {CUT: lambda points: posed[used][anatomy.bones[CUT]]}
    pose = CoupledPose({**toy.hinge(ANGLE).bones, **held}, toy.hinge(ANGLE).tensions)
    start = part.prescribed(pose, posed[used] + 0.05 * np.random.default_rng(0).normal(size=(len(used), 3)))
    found = solve(part.potentials(pose), start, fixed=part.fixed, options=OPTIONS).x
    assert np.abs(found - posed[used]).max() < 1e-5


def test_its_refinement_is_that_of_the_whole_but_for_what_the_cut_hides(whole, posed, chosen):
    fine = CoupledBody(whole.anatomy, toy.MATERIALS, order=2)
    x = solved_from(whole, posed, fine, toy.hinge(ANGLE), OPTIONS)
    full = difference(whole, posed, fine, x)["rms"][0]
    part = refinement_error(whole.anatomy, toy.MATERIALS, chosen, toy.hinge(ANGLE), posed, OPTIONS)["rms"][0]
    assert 0.3 * full < part < 1.2 * full
