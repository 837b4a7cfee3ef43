"""Hands from a template: `python -m handpipe.anatomy photograph`, `warp` and `family`.

photograph TEMPLATE.h5 CLICKS.yaml POINTS.mrk.json
    3D feature points of a person from those that were clicked in one photograph with a ruler.
warp TEMPLATE.h5 POINTS.mrk.json PERSON.h5
    The template carried to a person's 3D feature points.
family TEMPLATE.h5 HANDS.yaml FOLDER
    A template FOLDER/NAME.h5 for each hand of stated sizes.

TEMPLATE.h5 is an artifact of kind subject-template. Coordinates are mm in its frame; .mrk.json files may be
LPS, as 3D Slicer says in them. Output is written only where all of it could be computed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from handpipe.anatomy.person import feature_points
from handpipe.anatomy.person.family import family, lengths_of, read_family
from handpipe.anatomy.person.photograph import from_photograph, read_photograph
from handpipe.anatomy.person.subject_template import SpaceMap, SubjectTemplate, warped
from handpipe.anatomy.person.warp import biharmonic_warp, feature_warp, require_invertible
from handpipe.core import Parser, run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if it succeeded, 1 with a line that says why not."""
    return run(_parser(), arguments)


def photograph(options: argparse.Namespace) -> None:
    """Write the feature points that a photograph shows, and print how well they fit the template."""
    template, clicks = _template(options), read_photograph(options.clicks)
    lifted = from_photograph(template, clicks, options.clicks)
    feature_points.write(options.output, lifted.points)
    print(f"points    {len(lifted.points):7d}")
    print(f"size      {lifted.size:7.3f} of the template's")
    print(f"residual  {lifted.residual:7.2f} mm in the plane of the hand")
    if lifted.mirrored:
        print("mirrored: the photograph shows the palm of the template's hand, or the back of the other hand")


def warp(options: argparse.Namespace) -> None:
    """Write the template of the person who has the feature points."""
    template = _template(options)
    points = feature_points.read(options.points)
    own = template.feature_points
    feature_points.require_plausible(own, points, options.points)
    field: SpaceMap = (
        biharmonic_warp(own, points, options.points)
        if options.same_pose
        else feature_warp(template, points, options.points)
    )
    require_invertible(field, template, options.points)
    person = warped(template, field)
    person.save(options.output, [options.template, options.points])
    _print_lengths({"template": template, "person": person})


def family_of_hands(options: argparse.Namespace) -> None:
    """Write the template of each hand of a family."""
    template = _template(options)
    hands = family(template, read_family(options.hands), options.hands)
    for name, hand in hands.items():
        hand.save(options.output / f"{name}.h5", [options.template, options.hands])
    _print_lengths({"template": template, **hands})
    others = sorted(path.name for path in options.output.glob("*.h5") if path.stem not in hands)
    if others:
        text = f"handpipe: {options.output} holds {', '.join(others)}, too, of no hand in {options.hands}"
        print(text, file=sys.stderr)


def _template(options: argparse.Namespace) -> SubjectTemplate:
    template = SubjectTemplate.load(options.template)
    return template.mirrored() if options.mirror else template


def _print_lengths(hands: dict[str, SubjectTemplate]) -> None:
    """A table of the lengths of long bones in mm, a column for each hand."""
    lengths = {name: lengths_of(hand) for name, hand in hands.items()}
    print(" ".join([f"{'mm':12s}", *(f"{name:>12s}" for name in hands)]))
    for bone in lengths["template"]:
        print(" ".join([f"{bone:12s}", *(f"{lengths[name][bone]:12.1f}" for name in hands)]))


def _parser() -> argparse.ArgumentParser:
    prog = "python -m handpipe.anatomy"
    parser = Parser(prog=prog, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, about: str) -> argparse.ArgumentParser:
        found: argparse.ArgumentParser = commands.add_parser(name, help=about, description=about)
        found.add_argument("template", type=Path, metavar="TEMPLATE.h5", help="kind subject-template")
        found.add_argument("--mirror", action="store_true", help="take the template of the other hand")
        return found

    lifted = command("photograph", "3D feature points from one photograph with a ruler in it")
    lifted.add_argument("clicks", type=Path, metavar="CLICKS.yaml", help="pixels of points and of the ruler")
    lifted.add_argument("output", type=Path, metavar="POINTS.mrk.json", help="written: points in mm")
    lifted.set_defaults(run=photograph)

    carried = command("warp", "carry the template to a person's 3D feature points")
    carried.add_argument("points", type=Path, metavar="POINTS.mrk.json", help="labels are feature points")
    carried.add_argument("output", type=Path, metavar="PERSON.h5", help="written: the person's template")
    carried.add_argument(
        "--same-pose",
        action="store_true",
        help="for points of a hand in the template's pose, as of a photograph: do not pose it first",
    )
    carried.set_defaults(run=warp)

    resized = command("family", "a template for each hand of stated sizes")
    resized.add_argument("hands", type=Path, metavar="HANDS.yaml", help="sizes of each hand")
    resized.add_argument("output", type=Path, metavar="FOLDER", help="written: NAME.h5 of each hand")
    resized.set_defaults(run=family_of_hands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
