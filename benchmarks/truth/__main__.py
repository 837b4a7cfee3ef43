"""Run as `python -m benchmarks.truth --output FILE`: figures of the toy finger; pictures beside them."""

from __future__ import annotations

import argparse
import json
import logging
from pathlib import Path

import numpy as np

from benchmarks.truth import toy
from benchmarks.truth.engines import engine_differences
from benchmarks.truth.measured import LoadingPaths, measure
from benchmarks.truth.pictures import convergence, cut_open
from benchmarks.truth.refinement import figures, solved
from benchmarks.truth.touching import contact_differences
from handpipe.core import metrics
from handpipe.synthetic.coupled.coupled_body import CoupledBody, CoupledPose

EDGE, ANGLE, AWAY = 4.5, np.radians(40.0), np.radians(-15.0)
COARSE_EDGE, COARSE_ANGLE, REFINEMENTS = 6.5, np.radians(40.0), 2
ENGINE_EDGE, ENGINE_DEGREES, CONTACT_EDGE = 6.0, (2.0, 20.0, 40.0), 2.5


def back(t: float) -> CoupledPose:
    """From the detour to the pose."""
    return toy.hinge(AWAY + (ANGLE - AWAY) * t)


def main(output: Path) -> None:
    """All figures; the study of refinement takes several times the rest."""
    folder = output.parent
    folder.mkdir(parents=True, exist_ok=True)
    ways = LoadingPaths(lambda t: toy.hinge(ANGLE * t), lambda t: toy.hinge(AWAY * t, 0.0), back)
    body, x, found = measure(toy.finger(EDGE), lambda a: CoupledBody(a, toy.MATERIALS), ways)
    other = engine_differences(ENGINE_EDGE, ENGINE_DEGREES) | contact_differences(CONTACT_EDGE)
    metrics.write(output, found | other)
    cut_open(folder / "truth-toy.png", body, x)
    table = figures(solved(COARSE_EDGE, COARSE_ANGLE, REFINEMENTS))
    (folder / "truth-refinement.json").write_text(json.dumps(table, indent=2), encoding="utf-8")
    convergence(folder / "truth-convergence.png", table)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO)
    parser = argparse.ArgumentParser(prog="benchmarks.truth")
    parser.add_argument("--output", type=Path, required=True, help="JSON of the figures")
    main(parser.parse_args().output)
