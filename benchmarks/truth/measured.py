"""The figures of a coupled truth, for `truth.json`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from handpipe.core import Array, Metrics
from handpipe.core.metrics import measured
from handpipe.fem.solver import Options
from handpipe.synthetic.continuum.strands import Strands
from handpipe.synthetic.coupled import patch_test, volume_changes
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody, CoupledPose
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.validation import difference, solved_from, start_difference

Motion = Callable[[float], CoupledPose]


@dataclass(frozen=True)
class LoadingPaths:
    """Two ways from rest to one pose: straight, and by a detour and back from there."""

    straight: Motion
    detour: Motion
    back: Motion


def measure(
    anatomy: CoupledAnatomy,
    make: Callable[[CoupledAnatomy], CoupledBody],
    ways: LoadingPaths,
    *,
    refinement: bool = True,
    options: Options | None = None,
) -> tuple[CoupledBody, Array, Metrics]:
    """A body `make(anatomy)`, its equilibrium (n, 3) at the ways' end, and what it says about itself.

    `refinement` compares with the body whose tets are cut into eight, which takes far longer than the rest
    and has no contact.
    """
    with measured({}) as metrics:
        body = make(anatomy)
        found = follow(body, ways.straight, options=options)
    x, pose = found.x, ways.straight(1.0)
    metrics["tets"], metrics["nodes"] = (len(anatomy.mesh.tets), "1"), (len(x), "1")
    metrics["iterations"] = (found.record.iterations, "1")
    metrics["volume_ratio_min"] = (float(body.solid.volume_ratios(x).min()), "1")
    metrics["inverted_tets"] = (body.inverted(x), "1")
    changes = volume_changes(body, x)
    metrics["muscle_volume_change_max"] = (max(map(abs, changes.values())), "%")
    strains = [s.strains(x).max() for s in body.strands.values() if isinstance(s, Strands)]
    if strains:
        metrics["strand_strain_max"] = (max(strains) * 100.0, "%")
    metrics["patch_test_error"] = (patch_test(body), "mm")
    apart = start_difference(body, ways.detour, ways.back, x, options=options)
    metrics["start_difference_max"] = (apart, "mm")
    if body.barrier is not None:
        metrics["self_intersections"] = (float(body.barrier.intersects(x)), "1")
    if refinement:
        fine = make(anatomy.refined())
        near = difference(body, x, fine, solved_from(body, x, fine, pose, options))
        metrics |= {f"refinement_{name}": value for name, value in near.items()}
    return body, x, metrics
