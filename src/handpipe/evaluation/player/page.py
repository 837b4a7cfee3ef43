"""The page of a learned hand: one HTML file with its arrays and scripts in it, which needs no network."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from handpipe.core import Shape, write_text
from handpipe.evaluation.player.drawn_hand import drawn_hand
from handpipe.evaluation.player.landmark_places import landmark_places
from handpipe.evaluation.player.packed_hand import packed_hand
from handpipe.evaluation.player.packed_image import packed_image
from handpipe.evaluation.sides import AXES, view_directions
from handpipe.evaluation.viewer import import_map
from handpipe.hand import FINGERS, colour, opacity, tissue, vertex_colours
from handpipe.imaging.volumes import Volume
from handpipe.levels import RIGID_LAYER, Errors, LearnedBody, LearnedHand
from handpipe.skeleton.rig import Rig, hand_directions

MODULES = ("learned-hand", "reach", "similarity", "landmark-fit", "landmark-file", "tracked", "slice")
OTHER = "other joints"
DIGITS = 3  # of a slider's limits in degrees
SHEETS = "fascia"  # layers so named cover others: the page begins without them


def write_player(
    path: str | Path,
    subject: str,
    hand: LearnedHand,
    rig: Rig,
    side: str,
    source: str = "simulated frames",
    image: Volume | None = None,
) -> None:
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
    source : str
        What the hand was learned from, from which the page states distances.
    image : Volume or None
        Neutral image, of which the page shows slices through a hand with a skin.
    """
    drawn = drawn_hand(hand)
    grid, further = None, _colours_and_cells(drawn)
    if image is not None and any(tissue(*body) == "skin" for body in drawn.bodies):
        grid, further["image"] = packed_image(image, drawn.rest)
    index, packed, rounding = packed_hand(drawn, further)
    data: dict[str, Any] = {
        "arrays": index,
        "rounding": rounding,
        "angles": _angles(drawn, rig),
        "poses": {"rest": [0.0] * len(drawn.angle_names), **_poses(drawn, rig)},
        "bodies": _bodies(drawn),
        "tips": _tips(drawn),
        "views": _views(rig, side),
        "image": grid,
        "landmarks": landmark_places(drawn, rig, side),
    }
    page = _template().render(
        subject=subject,
        source=source,
        data=data,
        fingers=_fingers(data["angles"]),
        layers={body["layer"]: body for body in data["bodies"]},
        errors=_errors(drawn),
        frames=max((e.frames for body in drawn.bodies.values() for e in body.errors.values()), default=0),
        packed=packed,
        import_map=import_map({name: _script(name.replace("-", "_") + ".js") for name in MODULES}),
        player=_script("player.js").decode("utf-8"),
    )
    write_text(path, page)


def _script(file: str) -> bytes:
    return (files("handpipe.evaluation.player") / "static" / file).read_bytes()


def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("handpipe.evaluation.player", "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # poses and views keep their order
    return environment.get_template("player.html.jinja")


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
            }
        )
    return found


def _fingers(angles: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Angles with their limits in degrees by finger, as the sliders have them."""
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in (OTHER, *FINGERS)}
    for angle in angles:
        degrees = np.round(np.degrees(angle["limits"]), DIGITS).tolist()
        found[angle["finger"]].append({"name": angle["name"], "degrees": degrees})
    return {finger: own for finger, own in found.items() if own}


def _errors(hand: LearnedHand) -> dict[str, dict[str, Errors]]:
    """Mean and largest error in mm of each tissue by level, and the number of frames."""
    found: dict[str, dict[str, Errors]] = {}
    bodies: dict[str, list[LearnedBody]] = {}
    for name, body in hand.bodies.items():
        if body.errors:
            bodies.setdefault(tissue(*name).replace("_", " "), []).append(body)
    for layer, own in bodies.items():
        counts = [len(body.rest) for body in own]
        for level in own[0].errors:
            errors = [body.errors[level] for body in own]
            mean = float(np.average([e.mean for e in errors], weights=counts))
            found.setdefault(layer, {})[level] = Errors(
                mean, max(e.largest for e in errors), errors[0].frames
            )
    return found


def _colours_and_cells(hand: LearnedHand) -> dict[str, NDArray]:
    found: dict[str, NDArray] = {}
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
