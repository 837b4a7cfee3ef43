"""A scan aligned to the skin in the image of its pose: rigid, by joint, then smooth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.scan_alignment.articulated import Articulation, articulate
from handpipe.skeleton.scan_alignment.image_skin import ImageSkin
from handpipe.skeleton.scan_alignment.matches import Matches
from handpipe.skeleton.scan_alignment.rigid_start import rigid_start
from handpipe.skeleton.scan_alignment.smooth_offset import smooth_offset, vertex_areas

NEAR = 1.5  # mm; vertices farther than this off the skin after the joints are turned do not fit


@dataclass(frozen=True)
class Alignment:
    """An aligned scan, and how far it was from the skin of the image.

    Parameters
    ----------
    surface : Surface
        The scan in the frame of the pose's volume, mm; vertices and triangles in the scan's order.
    motion : RigidTransform
        Rigid part of the alignment: from the scan's frame into the volume's.
    joint_angles : dict of str to float
        Angle in deg by which each joint was turned, by name.
    residual : float
        Mean distance in mm from the skin after the joints are turned, before the smooth field.
    off : float
        Share of the scan's area that is then more than `NEAR` mm from the skin.
    off_parts : dict of str to float
        The same of the part of the skin at each bone.
    volume_ratio : float
        Volume of the scan over that of the image's skin, as far as both cover the hand.
    left : float
        Mean distance in mm from the skin after the smooth field.
    """

    surface: Surface
    motion: RigidTransform
    joint_angles: dict[str, float]
    residual: float
    off: float
    off_parts: dict[str, float]
    volume_ratio: float
    left: float


def align_scan(scan: Surface, skin: ImageSkin) -> Alignment:
    """Align a scan in any frame to the skin of its pose's image.

    Parameters
    ----------
    scan : Surface
        Surface in mm, with holes or not. It may face inwards.
    skin : ImageSkin
        Skin of the pose's image, with bones and joints.

    Returns
    -------
    Alignment
        Also where the scan does not fit: `require_same_hand` judges the figures.
    """
    outwards = scan if scan.volume() > 0 else scan.flipped()
    found = articulate(outwards, skin, rigid_start(outwards, skin.surface, skin.trusted))
    straight = _straightened(outwards, skin, found)
    aligned = smooth_offset(straight, skin, outwards.volume())
    areas = vertex_areas(straight)
    before, after = _matched(straight, skin), _matched(aligned, skin)
    fits, on_skin = areas * before.valid, areas * skin.trusted[before.corners].all(axis=1)
    off = (np.abs(before.signed) > NEAR).astype(float)
    part = skin.part[before.corners[:, 0]]
    return Alignment(
        aligned if outwards is scan else aligned.flipped(),
        found.motion,
        found.angles(skin.free),
        _mean(np.abs(before.signed), fits),
        _mean(off, on_skin),
        {bone: _mean(off, on_skin * (part == i)) for i, bone in enumerate(skin.bones)},
        1.0 + float(fits @ before.signed) / abs(skin.surface.volume()),
        _mean(np.abs(after.signed), areas * after.valid),
    )


def _matched(scan: Surface, skin: ImageSkin) -> Matches:
    return Matches.find(scan.vertices, scan.vertex_normals(), Distance(skin.surface), skin.trusted)


def _mean(values: Array, weights: Array) -> float:
    return float(weights @ values / max(float(weights.sum()), 1e-12))


def _straightened(scan: Surface, skin: ImageSkin, found: Articulation) -> Surface:
    """The scan in the image's pose: each vertex moved back by the blend at its place on the posed skin."""
    posed = found.posed(skin)
    here = scan.moved(found.motion(scan.vertices))
    match = Matches.find(here.vertices, here.vertex_normals(), Distance(posed), skin.trusted)
    turns, shifts = found.blends(skin, match.interpolation(posed.vertices) @ skin.weights)
    return here.moved(turns.inv().apply(here.vertices - shifts))
