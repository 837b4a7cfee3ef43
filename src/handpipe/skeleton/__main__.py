"""`python -m handpipe.skeleton next-pose RIG.h5 CANDIDATES.csv`: which poses to scan next, the best first.

RIG.h5 is a rig of a build (kind rig): what its poses tell is known already. CANDIDATES.csv is a table of
joint angles in degrees, a row for each pose that the person could hold, as for the frames of a scene.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Sequence
from pathlib import Path

from handpipe.core import Parser, run, whole_number, write_text
from handpipe.skeleton.joints.angles import read_angles
from handpipe.skeleton.rig.next_pose import RigUncertainty, plan_poses
from handpipe.skeleton.rig.rig import Rig


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if it succeeded, 1 with a line that says why not."""
    return run(_parser(), arguments)


def next_pose(options: argparse.Namespace) -> None:
    """Print, and write where asked, the order in which to scan poses and the error after each."""
    rig = Rig.load(options.rig)
    candidates = read_angles(options.candidates, rig.limits)
    known = RigUncertainty.of_rig(rig)
    plan = plan_poses(known, candidates, options.count or len(candidates))
    if options.output is not None:
        write_text(options.output, _table(plan))
    print(f"{'now':24s} {known.error:7.3f} mm")
    for name, error in plan:
        print(f"{name:24s} {error:7.3f} mm")


def _table(plan: Sequence[tuple[str, float]]) -> str:
    """CSV of poses in the order to scan them, each with the error in mm that is left after it."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([("pose", "error [mm]"), *plan])
    return text.getvalue()


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m handpipe.skeleton", description=__doc__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    about = "which poses to scan next: expected error of the bones in mm after each, the best pose first"
    found = commands.add_parser("next-pose", help=about, description=about)
    found.add_argument("rig", type=Path, metavar="RIG.h5", help="kind rig")
    found.add_argument("candidates", type=Path, metavar="CANDIDATES.csv", help="poses, angles in degrees")
    found.add_argument("--count", type=whole_number(1, 1e6), help="how many to plan; by default all")
    found.add_argument("--output", type=Path, metavar="PLAN.csv", help="written: pose, error in mm")
    found.set_defaults(run=next_pose)
    return parser


if __name__ == "__main__":
    sys.exit(main())
