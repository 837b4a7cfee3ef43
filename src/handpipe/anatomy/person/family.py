"""Hands of stated sizes and proportions: a template grown to given lengths of its bones.

Lengths of a median adult male hand, in mm: Buryanov and Kotiuk 2010, "Proportions of hand segments", as
compiled second hand with the reference measurements that the project was given; no deviations are stated
there, so that a family's spread is the user's choice.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from handpipe.anatomy.person.bony_points import away_from
from handpipe.anatomy.person.posing import OF_RAYS, Skeleton
from handpipe.anatomy.person.subject_template import SubjectTemplate, warped
from handpipe.anatomy.person.warp import require_invertible
from handpipe.core import Array, InputError
from handpipe.core.configuration import Length, Model, Name, load_yaml
from handpipe.mesh.surfaces import Biharmonic
from handpipe.tissues.muscles.fitting import Affine

KINDS = {4: OF_RAYS, 3: ("metacarpal", "proximal", "distal")}
RAYS = {
    1: (49.0, 32.0, 22.0),
    2: (66.0, 40.0, 22.0, 16.0),
    3: (69.0, 44.0, 24.0, 17.0),
    4: (65.0, 41.0, 22.0, 16.0),
    5: (57.0, 31.0, 18.0, 14.0),
}
MEDIAN_MALE = {
    f"{kind}{ray}": length
    for ray, lengths in RAYS.items()
    for kind, length in zip(KINDS[len(lengths)], lengths, strict=True)
}
CHILD = 0.6  # of an adult's lengths: about five years old
ROUNDS = 8  # of the search, at most
MET = 0.01  # mm


class StatedHand(Model):
    """Sizes of one hand of a family."""

    base: Literal["median-male", "template"] = Field(
        "median-male", description="whose lengths of bones the hand starts from"
    )
    size: float = Field(1.0, gt=0, allow_inf_nan=False, description="factor of the lengths of the base")
    lengths: dict[str, Length] = Field(
        {}, description="lengths of single bones in mm, in place of those of the base"
    )
    across: float | None = Field(
        None,
        gt=0,
        allow_inf_nan=False,
        description="factor of the template across the bones and in the palm; "
        "by default the mean ratio of the lengths to the template's",
    )

    def bone_lengths(self, own: Mapping[str, float]) -> dict[str, float]:
        """Lengths in mm of all long bones; `own`: those of the template."""
        base = own if self.base == "template" else {b: MEDIAN_MALE[b] for b in own}
        return sized(self.size, base) | self.lengths


class Family(Model):
    """Hands to make of one template."""

    hands: dict[Name, StatedHand] = Field(min_length=1)


def read_family(path: str | Path) -> Family:
    """Read the sizes of hands from YAML.

    Parameters
    ----------
    path : path
        YAML file.

    Returns
    -------
    Family
        Sizes by hand.

    Raises
    ------
    InputError
        For the first wrong field.
    """
    return load_yaml(path, Family)


def family(
    template: SubjectTemplate, wanted: Family, origin: str | Path = "family"
) -> dict[str, SubjectTemplate]:
    """A template of each hand of a family.

    Parameters
    ----------
    template : SubjectTemplate
        Template to be resized.
    wanted : Family
        Sizes by hand.
    origin : path
        The file of the family, for messages.

    Returns
    -------
    mapping of str to SubjectTemplate
        Templates by hand.

    Raises
    ------
    InputError
        As in `resized`; the text names hand and bone.
    """
    own = lengths_of(template)
    return {
        name: resized(template, hand.bone_lengths(own), hand.across, f"{origin}: hands.{name}.lengths")
        for name, hand in wanted.hands.items()
    }


def lengths_of(template: SubjectTemplate) -> dict[str, float]:
    """Greatest extent of each long bone of the rays along its own axis.

    Parameters
    ----------
    template : SubjectTemplate
        Template with bones and joints.

    Returns
    -------
    dict of str to float
        Lengths in mm by bone, those that the template has.
    """
    carried = {joint.child: joint.centre for joint in template.joints}
    carried |= {joint.parent: joint.centre for joint in template.joints if joint.parent not in carried}
    found = {}
    for bone in MEDIAN_MALE:
        if bone in carried and bone in template.bones:
            surface = template.bones[bone]
            found[bone] = float(np.ptp(surface.vertices @ away_from(surface, carried[bone])))
    return found


def sized(scale: float, base: Mapping[str, float] = MEDIAN_MALE) -> dict[str, float]:
    """Lengths of a hand of the same proportions, e.g. `sized(CHILD)`."""
    return {bone: scale * length for bone, length in base.items()}


def family_warp(
    template: SubjectTemplate,
    lengths: Mapping[str, float],
    scale: float | None = None,
    origin: str | Path = "lengths",
) -> Biharmonic:
    """The warp that grows a template in its pose until its bones have given lengths.

    Every bone grows along its own axis from the joint that carries it, and by `scale` across the axis, as do
    the carpus and the palm's width. The space between bones follows biharmonically. Lengths of warped
    surfaces are met to 0.1 mm.

    Parameters
    ----------
    template : SubjectTemplate
        Template to be resized.
    lengths : mapping of str to float
        Lengths in mm by bone.
    scale : float, optional
        Size of the hand over that of the template; by default the mean ratio of the lengths.
    origin : path
        The source of the lengths, for messages.

    Returns
    -------
    Biharmonic
        Map of points in mm.

    Raises
    ------
    InputError
        For bones that the template lacks, and for lengths outside a third to three times its own.
    """
    own = lengths_of(template)
    for bone, length in lengths.items():
        if bone not in own:
            raise InputError(origin, bone, "is no long bone of the template", f"Give {', '.join(own)}")
        if not own[bone] / 3 < length < 3 * own[bone]:
            problem = f"{length:g} mm, where the template has {own[bone]:.1f} mm"
            raise InputError(origin, bone, problem, "Give lengths in mm, of a hand")
    if scale is None:
        scale = float(np.exp(np.mean([np.log(length / own[b]) for b, length in lengths.items()])))
    skeleton, root = Skeleton(template), Affine(scale * np.eye(3), np.zeros(3))
    factors = {bone: length / own[bone] / scale for bone, length in lengths.items()}
    for _ in range(ROUNDS):
        warp = skeleton.field(skeleton.maps(root, lengths=factors))
        found = lengths_of(warped(_rays(template, lengths), warp))
        if max(abs(found[bone] - length) for bone, length in lengths.items()) < MET:
            break
        factors = {bone: factors[bone] * length / found[bone] for bone, length in lengths.items()}
    return warp


def _rays(template: SubjectTemplate, lengths: Mapping[str, float]) -> SubjectTemplate:
    """The part of the template that determines its lengths."""
    joints = tuple(j for j in template.joints if {j.parent, j.child} & set(lengths))
    bones = {b for j in joints for b in (j.parent, j.child)}
    return SubjectTemplate(template.side, {b: template.bones[b] for b in bones}, joints)


def target_points(
    template: SubjectTemplate, lengths: Mapping[str, float], scale: float | None = None
) -> dict[str, Array]:
    """Feature points (3,) of a person whose bones have the given lengths; errors as `family_warp`."""
    warp = family_warp(template, lengths, scale)
    return {name: warp(point[None])[0] for name, point in template.feature_points.items()}


def resized(
    template: SubjectTemplate,
    lengths: Mapping[str, float],
    scale: float | None = None,
    origin: str | Path = "lengths",
) -> SubjectTemplate:
    """The template of a person whose bones have given lengths.

    Parameters
    ----------
    template, lengths, scale, origin
        As in `family_warp`.

    Returns
    -------
    SubjectTemplate
        The template of that person.

    Raises
    ------
    InputError
        As in `family_warp`, and where neighbouring fingers grow so differently that the warp inverts the
        space between them: from about 25 % difference in a hand whose fingers lie side by side.
    """
    warp = family_warp(template, lengths, scale, origin)
    require_invertible(warp, template, origin)
    return warped(template, warp)
