"""The page of a learned hand: one HTML file with its arrays and scripts in it, which needs no network."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from handpipe.core import Array, Shape, write_text
from handpipe.evaluation.player.drawn_hand import RIGID_LAYER, drawn_hand
from handpipe.evaluation.player.packed_hand import packed_hand
from handpipe.evaluation.sides import AXES, view_directions
from handpipe.evaluation.viewer import import_map
from handpipe.hand import FINGERS, colour, opacity, tissue, vertex_colours
from handpipe.levels import LearnedHand
from handpipe.skeleton.rig import Rig, hand_directions

SCRIPTS = {"learned-hand": "learned_hand.js", "reach": "reach.js"}  # modules of the page by their names
OTHER = "other joints"
SHEETS = "fascia"  # layers so named cover others: the page begins without them


def write_player(path: str | Path, subject: str, hand: LearnedHand, rig: Rig, side: str) -> None:
    """Write a page that moves a hand.

    Parameters
    ----------
    path : path
        File to be written.
    subject : str
        Name that the page shows.
    hand : LearnedHand
        Hand of all bodies.
    rig : Rig
        Joints with their limits, and scanned poses.
    side : str
        "right" or "left".
    """
    drawn = drawn_hand(hand)
    index, packed, rounding = packed_hand(drawn, _colours_and_cells(drawn))
    data = {
        "arrays": index,
        "rounding": rounding,
        "angles": _angles(drawn, rig),
        "poses": {"rest": [0.0] * len(drawn.angle_names), **_poses(drawn, rig)},
        "bodies": _bodies(drawn),
        "tips": _tips(drawn),
        "views": _views(rig, side),
    }
    static = files("handpipe.evaluation.player") / "static"
    scripts = {name: (static / file).read_bytes() for name, file in SCRIPTS.items()}
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("handpipe.evaluation.player", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}
    page = environment.get_template("player.html.jinja").render(
        subject=subject,
        data=data,
        packed=packed,
        import_map=import_map(scripts),
        player=(static / "player.js").read_text(encoding="utf-8"),
    )
    write_text(path, page)


def _angles(hand: LearnedHand, rig: Rig) -> list[dict[str, Any]]:
    """Name, finger and limits in rad of each angle, in the hand's order."""
    limits, fingers = rig.limits, {digit: name for name, digit in FINGERS.items()}
    finger = {angle: fingers.get(joint.child[-1], OTHER) for joint in rig.joints for angle in joint.angles}
    return [{"name": n, "finger": finger[n], "limits": [*map(float, limits[n])]} for n in hand.angle_names]


def _poses(hand: LearnedHand, rig: Rig) -> dict[str, list[float]]:
    """Angles in rad of the scanned poses, without those at rest."""
    found = {name: [pose.angles[n] for n in hand.angle_names] for name, pose in rig.poses.items()}
    return {name: values for name, values in found.items() if not np.allclose(values, 0)}


def _bodies(hand: LearnedHand) -> list[dict[str, Any]]:
    """Each body's place among the vertices, its look and its errors; `bone`: -1 of soft bodies."""
    found, end = [], 0
    for (layer, name), body in hand.bodies.items():
        look, start, end = tissue(layer, name), end, end + len(body.rest)
        found.append(
            {
                "name": name,
                "layer": look.replace("_", " "),
                "colour": colour(look),
                "opacity": opacity(look),
                "hidden": look.endswith(SHEETS),
                "start": start,
                "end": end,
                "bone": hand.bones.index(name) if layer == RIGID_LAYER else -1,
                "errors": {level: vars(errors) for level, errors in body.errors.items()},
            }
        )
    return found


def _colours_and_cells(hand: LearnedHand) -> dict[str, Array]:
    found = {}
    for number, ((layer, name), body) in enumerate(hand.bodies.items()):
        shape = Shape(body.rest, body.rest, body.cells, dict(body.fields))
        rgb = vertex_colours(tissue(layer, name), shape)
        found[f"cells_{number}"] = body.cells
        if rgb is not None:
            found[f"colours_{number}"] = np.round(255 * rgb).astype("u1")
    return found


def _tips(hand: LearnedHand) -> list[dict[str, Any]]:
    """Points to drag: of each moving bone that carries no other one, its point farthest from its joint."""
    joints = hand.skeleton.joints
    ends = set(range(1, len(hand.bones))) - set(joints.parents.tolist())
    heaviest, found = hand.joints[np.arange(len(hand.joints)), hand.weights.argmax(axis=1)], []
    for bone in sorted(ends):
        own = hand.rest[heaviest == bone]
        if joints.dofs[bone - 1] and len(own):
            far = own[np.linalg.norm(own - joints.centres[bone - 1], axis=1).argmax()]
            found.append({"bone": bone, "name": hand.bones[bone], "point": far.tolist()})
    return found


def _views(rig: Rig, side: str) -> dict[str, list[float]]:
    directions = hand_directions(rig, "left" if side == "left" else "right") or AXES
    return {name: np.concatenate(pair).tolist() for name, pair in view_directions(directions).items()}
