"""A hand of known sizes, and a picture of it lying flat beside a bank card."""

from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from handpipe.anatomy.person import Photograph, SubjectTemplate
from handpipe.anatomy.person.family import lengths_of, resized
from handpipe.anatomy.shipped import ShippedHand
from handpipe.cli.person.played_hand import PlayedHand
from handpipe.core import Frame

CARD = 85.6  # mm
PIXELS = 6.0  # a mm
CORNER = np.array([700.0, 1250.0])  # pixel of the origin of the hand's frame
SIZE = (1400, 1500)
TURNED = {"MP2_abduction": 5.0, "MP4_abduction": -3.0, "MP5_abduction": -8.0, "MP3_flexion": 4.0}  # deg
FACTORS = (0.83, 0.9, 0.86)  # of the template's lengths of bones, in turn
RULER = ((120.0, 1400.0), (120.0 + CARD * PIXELS, 1400.0))


@cache
def truth(side: str = "right") -> SubjectTemplate:
    """The shipped hand with other lengths of each bone."""
    template = ShippedHand.load().template
    own = lengths_of(template)
    wanted = {bone: FACTORS[i % 3] * length for i, (bone, length) in enumerate(own.items())}
    found = resized(template, wanted)
    return found if side == "right" else found.mirrored()


@cache
def lying(side: str = "right") -> tuple[dict[str, np.ndarray], PlayedHand]:
    """Feature points (3,) of that hand, nearly flat, carried by the rig's bones; and the hand."""
    hand = PlayedHand.of(ShippedHand.load(side), truth(side))
    turned = hand.rig.bone_transforms(angles(hand))
    owner = {joint.name: joint.parent for joint in truth(side).joints}
    owner |= {f"tip{ray}": f"distal{ray}" for ray in range(1, 6)}
    found = {}
    for name, point in truth(side).feature_points.items():
        found[name] = turned[owner[name]](point)
    return found, hand


def angles(hand: PlayedHand) -> dict[str, float]:
    """Angles in rad of the photographed pose: the fingers are spread more than in the expected one."""
    flat = hand.flat
    return {name: value + np.radians(TURNED.get(name, 0.0)) for name, value in flat.items()}


def seen(points: np.ndarray, palm: bool = False) -> np.ndarray:
    """Pixels (n, 2) of points (n, 3), seen straight from the back with the fingers up, or from the palm."""
    return np.array([PIXELS, PIXELS]) * points[:, [1, 0]] * [1.0 if palm else -1.0, -1.0] + CORNER


def photograph(side: str = "right", palm: bool = False, **further) -> Photograph:
    points, _ = lying(side)
    pixels = seen(np.array([*points.values()]), palm)
    marked = {name: (float(x), float(y)) for name, (x, y) in zip(points, pixels, strict=True)}
    view = "palm" if palm else "back"
    fields = {"points": marked, "ruler": RULER, "distance": CARD, "hand": side, "view": view}
    return Photograph(**(fields | further))


def write_picture(path: Path, side: str = "right") -> None:
    """The skin as springs carry it, lighter where it faces up, on a dark table."""
    _, hand = lying(side)
    posed = angles(hand)
    skin = hand.springs.frame(Frame("shot", posed, hand.rig.bone_transforms(posed)), judged=False)["skin"][
        "skin"
    ]
    corners, image = skin.vertices[skin.cells], Image.new("RGB", SIZE, (52, 60, 70))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = normals[:, 2] / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    draw, pixels = ImageDraw.Draw(image), seen(corners.reshape(-1, 3)).reshape(-1, 3, 2)
    for i in np.argsort(corners[:, :, 2].mean(axis=1)):
        if up[i] > 0:
            light = 0.35 + 0.65 * up[i]
            draw.polygon([tuple(p) for p in pixels[i]], fill=tuple(int(light * c) for c in (224, 178, 150)))
    (x0, y), (x1, _) = RULER
    draw.rectangle([x0, y, x1, y + 60], fill=(235, 235, 225))
    image.save(path)
