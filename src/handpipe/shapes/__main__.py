"""`python -m handpipe.shapes template.vtk marks.mrk.json`: deform an organ's template to marks in an image.

Coordinates are mm, RAS; .mrk.json files may be LPS, as 3D Slicer says in them. Writes fitted.vtu (with the
plastic strains), surface.ply, quality.json and fit.h5 into the output folder. Until then the folder has
checkpoint.h5, from which the same command continues after an interruption.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from handpipe.core import Parser, number, reported, whole_number
from handpipe.fem.elements import Material
from handpipe.imaging.evidence import read_markers
from handpipe.imaging.volumes import read_volume
from handpipe.shapes.observations.given_frame import Sources
from handpipe.shapes.optimisation.settings import RANGES, OrganSettings
from handpipe.shapes.organs.files import read_pairs, read_template, write_fit
from handpipe.shapes.organs.organ import Observed, fit_organ


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if it succeeded, 1 with a line that says why not."""
    options = _parser().parse_args(arguments)
    level = logging.DEBUG if options.verbose else logging.INFO
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(message)s", stream=sys.stderr)
    logging.getLogger("handpipe.shapes").setLevel(level)
    with reported() as failure:
        run(options)
    return failure.code


def run(options: argparse.Namespace) -> None:
    """Read, fit, write, and print the quality."""
    attachments = None if options.attachments is None else read_pairs(*options.attachments)
    landmarks = None if options.landmarks is None else read_pairs(*options.landmarks)
    marks = None if options.marks is None else read_markers(options.marks)[0]
    settings = OrganSettings(
        alpha=options.alpha,
        beta=options.beta,
        iterations=options.iterations,
        enough=options.enough,
        outliers=options.outliers,
        covering=options.covering,
        remesh_below=options.remesh_below,
        material=Material(options.young, options.poisson),
    )
    fit = fit_organ(
        read_template(options.template),
        Observed(
            marks,
            attachments,
            landmarks,
            volume=None if options.volume is None else read_volume(options.volume),
        ),
        settings=settings,
        checkpoint=options.output / "checkpoint.h5",
        sources=Sources(
            options.template,
            options.marks or "marks",
            *(given[1] if given else name for name, given in _pairs(options).items()),
        ),
    )
    files = [
        options.template,
        options.marks,
        options.volume,
        *(options.attachments or ()),
        *(options.landmarks or ()),
    ]
    write_fit(options.output, fit, [f for f in files if f is not None])
    for name, (value, unit) in fit.quality.items():
        print(f"{name:28s} {value:10.4g} {unit}")


def _pairs(options: argparse.Namespace) -> dict[str, list[Path] | None]:
    return {"attachments": options.attachments, "landmarks": options.landmarks}


def _parser() -> argparse.ArgumentParser:
    known = OrganSettings()
    parser = Parser(prog="python -m handpipe.shapes", description=__doc__.split("\n")[0])
    parser.add_argument("template", type=Path, help="tet mesh: VTK, VTU, Gmsh...")
    parser.add_argument("marks", type=Path, nargs="?", help="marks on the boundary: .mrk.json")
    for name, what in (("attachments", "that other organs hold"), ("landmarks", "seen in the image")):
        parser.add_argument(
            f"--{name}",
            nargs=2,
            type=Path,
            metavar=("TEMPLATE.mrk.json", "IMAGE.mrk.json"),
            help=f"points {what}: on the template and in the image, the same labels",
        )
    parser.add_argument("--volume", type=Path, help="image in which marks are found: NIfTI, NRRD, DICOM")
    parser.add_argument("--output", type=Path, default=Path("organ"), help="folder; by default organ")
    parser.add_argument(
        "--alpha", type=number(*RANGES["alpha"]), default=known.alpha, help="weight of marks, 1/mm^2"
    )
    parser.add_argument(
        "--beta", type=number(*RANGES["beta"]), default=known.beta, help="weight of attachments, 1/mm^2"
    )
    parser.add_argument(
        "--iterations",
        type=whole_number(*RANGES["iterations"]),
        default=known.iterations,
        help="at most, at full weight",
    )
    parser.add_argument(
        "--enough", type=number(*RANGES["enough"]), default=known.enough, help="mm at the farthest mark"
    )
    parser.add_argument("--outliers", action="store_true", help="leave out marks far beyond the others")
    parser.add_argument("--covering", action="store_true", help="no part of the organ is far from all marks")
    parser.add_argument(
        "--remesh-below",
        type=number(*RANGES["remesh_below"]),
        default=known.remesh_below,
        help="smallest dihedral angle in degrees below which tets are made anew; 0: never",
    )
    parser.add_argument("--young", type=number(1e-6, 1e9), default=known.material.young, help="kPa")
    parser.add_argument("--poisson", type=number(0.0, 0.4999), default=known.material.poisson)
    parser.add_argument("--verbose", action="store_true")
    return parser


if __name__ == "__main__":
    sys.exit(main())
