"""Draw the skin over a joint with and without tendons.

python -m handpipe.develop.knuckles DATASET.yaml JOINT PICTURE.png

The picture is of the scanned pose that bends the joint most, after `snakemake ablations`: the skin of both
models from the side, and sections of both and of the true skin over the joint (Zheng 2022 Fig. 31a), with and
without strains of the fat.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from handpipe.core import Array, Frame, InputError, Parser, Shape, atomic, paths, reported
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.evaluation import Contours, Plane, draw_slice, outer_picture, png
from handpipe.evaluation.rendering import Camera
from handpipe.hand import read_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.baselines.knuckles import Knuckle, knuckles
from handpipe.stages.baselines.variants import PASSIVE
from handpipe.stages.truth import true_pose
from handpipe.tissues.fat import Skin

VARIANT = "no_tendons"
SIZE = (520, 420)  # pixels of the skin of a model
SEEN = 16.0  # mm around the skin over the joint that a picture shows
TRUE, WITH, WITHOUT = "#222222", "#1f6fd6", "#d6451f"


def knuckle_figure(dataset: Dataset, joint: str) -> Figure:
    """The skin over a joint by the full model and without tendons, beside the true one.

    Raises
    ------
    InputError
        For a joint that no tendon passes, or a subject without a truth.
    """
    found = {
        name: paths.at(p, subject=dataset.name) for name, p in (("rig", paths.RIG), ("skin", paths.SKIN))
    }
    rig, skin = Rig.load(found["rig"]), Skin.load(found["skin"])
    poses = [p for p in dataset.poses if p != dataset.neutral and dataset.has_skin(p)]
    tendons = [t.bones for t in dataset.tendons.values()]
    known = {k.joint: k for k in knuckles(rig, skin, poses, tendons)}
    if joint not in known:
        problem = "is no joint that a tendon passes"
        raise InputError(dataset.name, joint, problem, f"Give one of {', '.join(known)}")
    if dataset.truth is None:
        raise InputError(dataset.name, "truth", "is not known", "Give a generated subject")
    knuckle = known[joint]
    frame, skins = _skins(dataset.name, knuckle.pose)
    true = true_pose([dataset.path(dataset.truth.folder) / f"{knuckle.pose}.h5"], knuckle.pose)["skin"]
    home = rig.poses[knuckle.pose].root.inverse()
    truth = Surface(home(true["vertices"]), true["triangles"])
    parent = next(j.parent for j in rig.joints if j.name == joint)
    plane = _plane(skins["m0"], knuckle, frame.bones[parent].rotation @ knuckle.axis)
    figure = Figure(figsize=(11, 8), layout="constrained")
    axes = figure.subplots(2, 2)
    titles = {"m0": "with tendons", VARIANT: "without tendons"}
    for ax, (model, title) in zip(axes[0], titles.items(), strict=True):
        near = skins["m0"].vertices[knuckle.near]
        camera = Camera.fit(near, plane.normal - 0.3 * plane.up, plane.up, SIZE)
        ax.imshow(outer_picture({"fat": {"skin": skins[model]}}, camera, SIZE))
        ax.set_title(f"{title}, {knuckle.pose}", fontsize=10)
        ax.set_axis_off()
    for ax, (end, title) in zip(
        axes[1], (("", "with strains of the fat"), (PASSIVE, "without")), strict=True
    ):
        drawn = [
            Contours("true skin", [truth], TRUE),
            Contours("with tendons", [_surface(skins[f"m0{end}"])], WITH),
            Contours("without tendons", [_surface(skins[f"{VARIANT}{end}"])], WITHOUT),
        ]
        draw_slice(ax, None, plane, drawn)
        ax.set(xlim=(-SEEN, SEEN), ylim=(-0.8 * SEEN, 0.3 * SEEN), xlabel="mm", title=title)
        ax.set_aspect("equal")
        for contour in drawn:
            ax.plot([], [], color=contour.colour, label=contour.name)
        ax.legend(loc="lower center", fontsize=9)
    return figure


def _skins(subject: str, pose: str) -> tuple[Frame, dict[str, Shape]]:
    """The frame and the skins of both models in a pose, with and without strains."""
    full, without = (
        paths.at(pattern, subject=subject, pose=pose)
        for pattern in (paths.POSE_SKIN, paths.POSE_PASSIVE_SKIN)
    )
    own = paths.at(paths.ablated(paths.POSE_SKIN), subject=subject, pose=pose, variant=VARIANT)
    [(frame, models)] = read_frames(full)
    [(_, passive)] = read_frames(without)
    [(_, variants)] = read_frames(own)
    skins = {"m0": models["m0"], f"m0{PASSIVE}": passive["m1"], **variants}
    return frame, {name: shapes["skin"] for name, shapes in skins.items()}


def _surface(shape: Shape) -> Surface:
    return Surface(shape.vertices, shape.cells)


def _plane(skin: Shape, knuckle: Knuckle, axis: Array) -> Plane:
    """The plane across the joint's axis through the skin over it, outwards upwards."""
    normal = _surface(skin).vertex_normals()[knuckle.vertex]
    up = normal - (normal @ axis) * axis
    up /= np.linalg.norm(up)
    return Plane(skin.vertices[knuckle.vertex], np.cross(up, axis), up)


def main(arguments: list[str] | None = None) -> int:
    """Draw the figure and return the exit code."""
    parser = Parser(prog="python -m handpipe.develop.knuckles", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("dataset", type=Path, help="config/datasets/….yaml")
    parser.add_argument("joint", help="a joint that tendons pass")
    parser.add_argument("picture", type=Path, help="PNG file")
    options = parser.parse_args(arguments)
    with reported() as failure:
        figure = knuckle_figure(load_dataset(options.dataset), options.joint)
        with atomic(options.picture) as temporary:
            temporary.write_bytes(png(figure))
    return failure.code


if __name__ == "__main__":
    raise SystemExit(main())
