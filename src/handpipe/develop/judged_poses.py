"""Draw the best and the worst poses of hands: python -m handpipe.develop.judged_poses PICTURE.png FOLDER...

Poses are ranked by the mean distance of the full model's skin from the true skin. The picture has the three
least and the three largest means over all scanned poses but neutral, each from the back and from the palm.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from handpipe.core import Array, Frame, InputError, Parser, atomic, paths, reported
from handpipe.core.configuration import load_dataset
from handpipe.evaluation import camera_views, png
from handpipe.evaluation.rendering import COLOUR_MAP, Camera, ColourBar, Drawable, Image, render
from handpipe.hand import read_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.skin_distances import skin_distances
from handpipe.tissues.fat import Skin

DATASETS = Path("config/datasets")
SHOWN = 3  # poses at either end
SIZE = (380, 420)  # pixels of a view
SIDES = ("back", "palm")
LARGEST = 0.3  # mm at the end of the colours


@dataclass(frozen=True)
class JudgedPose:
    """The full model's skin in a scanned pose.

    distances (v,): of its vertices from the true skin in mm, NaN at the cut end.
    """

    hand: str
    side: Literal["right", "left"]
    role: str
    frame: Frame
    rig: Rig
    skin: Surface
    distances: Array

    @property
    def mean(self) -> float:
        """Mean distance in mm."""
        return float(np.nanmean(self.distances))

    @property
    def title(self) -> str:
        """The hand, the pose, whether it was fitted to, and its distances."""
        held = "held out" if self.role == "heldout" else self.role
        most = np.nanmax(self.distances)
        return f"{self.hand}, {self.frame.name} ({held})\nmean {self.mean:.3f}, largest {most:.2f} mm"


def judged_poses(folder: Path) -> list[JudgedPose]:
    """The scanned poses of a built subject but neutral.

    Parameters
    ----------
    folder : Path
        Results folder of the subject, whose dataset file is in `config/datasets`.

    Raises
    ------
    InputError
        For a subject without a truth, or one that is not built.
    """
    dataset = load_dataset(DATASETS / f"{folder.name}.yaml")
    if dataset.truth is None:
        raise InputError(folder, "truth", "is not known", "Give generated subjects")
    rig, skin = Rig.load(folder / paths.below(paths.RIG)), Skin.load(folder / paths.below(paths.SKIN))
    found = []
    for pose in [p for p in dataset.poses if p != dataset.neutral and dataset.has_skin(p)]:
        [(frame, models)] = read_frames(folder / paths.below(paths.POSE_SKIN, pose=pose))
        scan, truth = dataset.poses[pose].scan, dataset.truth.folder / f"{pose}.h5"
        assert scan is not None
        shapes, data = models["m0"], folder / "data"
        measured = skin_distances(rig, skin, {pose: {"m0": shapes}}, [data / scan], [data / truth])
        distances = np.full(len(shapes["skin"].vertices), np.nan)
        distances[measured.compared] = measured.to_truth[pose]["m0"]
        surface = Surface(shapes["skin"].vertices, shapes["skin"].cells)
        role = dataset.poses[pose].role.value
        found.append(JudgedPose(folder.name, dataset.hand, role, frame, rig, surface, distances))
    return found


def judged_figure(poses: Sequence[JudgedPose]) -> Figure:
    """The best poses above, the worst ones below, each from both sides.

    Parameters
    ----------
    poses : sequence of JudgedPose
        All poses of all hands, at least one.

    Returns
    -------
    Figure
    """
    ranked = sorted(poses, key=lambda pose: pose.mean)
    rows = [ranked[:SHOWN], ranked[-SHOWN:][::-1]]
    figure = Figure(figsize=(14, 7.0), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(14, 1), squeeze=False)[0]
    parts = left.subfigures(len(rows), SHOWN, squeeze=False)
    bar = ColourBar("mm", 0.0, LARGEST)
    for row, chosen in zip(parts, rows, strict=True):
        for part, pose in zip(row, chosen, strict=False):
            part.suptitle(pose.title, fontsize=10)
            for ax, side in zip(part.subplots(1, len(SIDES)), SIDES, strict=True):
                ax.imshow(_picture(pose, side, bar))
                ax.set_axis_off()
    colours = ScalarMappable(Normalize(0.0, LARGEST), COLOUR_MAP)
    figure.colorbar(colours, cax=right.subplots(), label="mm", extend="max")
    return figure


def _picture(pose: JudgedPose, side: str, bar: ColourBar) -> Image:
    direction, up = camera_views(pose.rig, pose.frame, pose.side)[side]
    camera = Camera.fit([pose.skin.vertices], direction, up, SIZE)
    return render([Drawable(pose.skin, bar.colours(np.nan_to_num(pose.distances)))], camera, SIZE)


def main(arguments: list[str] | None = None) -> int:
    """Draw the picture and return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.judged_poses", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("picture", type=Path, help="PNG file")
    parser.add_argument("folders", metavar="FOLDER", nargs="+", type=Path, help="results of a built hand")
    options = parser.parse_args(arguments)
    with reported() as failure:
        figure = judged_figure([pose for folder in options.folders for pose in judged_poses(folder)])
        with atomic(options.picture) as temporary:
            temporary.write_bytes(png(figure))
    return failure.code


if __name__ == "__main__":
    raise SystemExit(main())
