"""`python -m handpipe.develop.ship_template RESULTS`: renew the template hand that comes with handpipe.

RESULTS is the folder of a generated hand, as results/phantom-hand, with its target `anatomy` built.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from handpipe.anatomy.person import SubjectTemplate
from handpipe.anatomy.shipped import HAND, ship
from handpipe.anatomy.templates import TissueMesh
from handpipe.core import Parser, run
from handpipe.core.configuration import load_dataset
from handpipe.synthetic.template_hands import marked_ends

DATASET = Path("config/datasets/phantom-hand-complete.yaml")
POSES = Path("config/scenes/hand-poses.csv")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if it succeeded, 1 with a line that says why not."""
    parser = Parser(prog="python -m handpipe.develop.ship_template", description=__doc__)
    parser.add_argument("results", type=Path, metavar="RESULTS")
    parser.set_defaults(run=_ship)
    return run(parser, arguments)


def _ship(options: argparse.Namespace) -> None:
    subject = SubjectTemplate.load(options.results / "anatomy/subject.h5")
    template = TissueMesh.load(options.results / "anatomy/template.h5")
    ship(subject, marked_ends(template, subject), load_dataset(DATASET), HAND, POSES)
    print(HAND)


if __name__ == "__main__":
    sys.exit(main())
