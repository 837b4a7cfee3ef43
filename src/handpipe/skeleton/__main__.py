"""`python -m handpipe.skeleton`: which poses to scan next, and which muscles move the joints as wanted.

RIG.h5 is a rig of a build (kind rig): what its poses tell is known already. CANDIDATES.csv is a table of
joint angles in degrees, a row for each pose that the person could hold, as for the frames of a scene.
MOTION is what a scene's frames may be made of: keyframes, targets of inverse kinematics, frames of angles.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from handpipe.core import Parser, run, whole_number, write_text
from handpipe.skeleton.contraction import MuscleDrive, contractions_of_angles
from handpipe.skeleton.joints.angles import read_angles
from handpipe.skeleton.motion import RATE, expand_motion, is_motion, write_contractions
from handpipe.skeleton.rig.next_pose import RigUncertainty, plan_poses
from handpipe.skeleton.rig.rig import Rig

MISSED = 5.0  # deg, from which on the command names an angle


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


def contractions(options: argparse.Namespace) -> None:
    """Write the contractions of pseudo muscles that follow a motion, and print what they miss."""
    rig = Rig.load(options.rig)
    frames = (
        expand_motion(options.motion, rig).frames
        if is_motion(options.motion)
        else read_angles(options.motion, rig.limits)
    )
    drive = MuscleDrive.of_rig(rig)
    found = contractions_of_angles(drive, list(frames.values()), 1.0 / RATE)
    write_contractions(options.output, drive.muscles, list(frames), found.contractions)
    errors = np.degrees(np.abs(found.errors))
    print(f"{len(frames)} frames: angles are missed by {errors.mean():.1f} deg on average")
    for name, largest in zip(drive.muscles.angles, errors.max(axis=0), strict=True):
        if largest >= MISSED:
            print(f"{name:24s} by up to {largest:5.1f} deg")


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
    about = "contractions of muscles that move the joints as a motion does, with little effort"
    made = commands.add_parser("contractions", help=about, description=about)
    made.add_argument("rig", type=Path, metavar="RIG.h5", help="kind rig")
    made.add_argument("motion", type=Path, metavar="MOTION", help="keyframes, targets or frames of angles")
    made.add_argument("output", type=Path, metavar="CONTRACTIONS.csv", help="written: a key for each frame")
    made.set_defaults(run=contractions)
    return parser


if __name__ == "__main__":
    sys.exit(main())
