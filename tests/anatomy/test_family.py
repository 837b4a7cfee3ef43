"""Hands of stated sizes: lengths are met, the rest follows."""

import numpy as np
import pytest
import trimesh
from tests.anatomy.hand_templates import phantom

from handpipe.anatomy.person import family
from handpipe.anatomy.person.subject_template import warped
from handpipe.anatomy.person.warp import folds
from handpipe.core.errors import InputError
from handpipe.core.rigid import RigidTransform


@pytest.fixture(scope="module")
def template():
    return phantom()


def surface_box(surface):
    """Lengths of the sides of the least box around a bone, greatest first."""
    _, size = trimesh.bounds.oriented_bounds(surface.vertices)
    return np.sort(size)[::-1]


def test_the_phantom_has_the_table_it_was_made_from(template):
    """Carving of joints and the bones' own axes cost its bones a little of their lengths."""
    own = family.lengths_of(template)
    assert set(own) == set(family.MEDIAN_MALE) and len(own) == 19
    for bone, length in own.items():
        assert length == pytest.approx(family.MEDIAN_MALE[bone], abs=1.5), bone


def test_lengths_are_met_to_a_tenth_of_a_millimetre(template):
    rng = np.random.default_rng(5)
    wanted = {b: v * (1 + 0.06 * rng.standard_normal()) for b, v in family.MEDIAN_MALE.items()}
    warp = family.family_warp(template, wanted)
    grown = warped(template, warp)
    assert folds(warp, template) == {}
    own = family.lengths_of(grown)
    assert max(abs(own[b] - wanted[b]) for b in wanted) < 0.1
    for bone, length in wanted.items():
        assert surface_box(grown.bones[bone])[0] == pytest.approx(length, abs=0.6), bone


def test_a_childs_hand_is_an_adults_made_smaller(template):
    adult = family.lengths_of(template)
    child = family.resized(template, {b: family.CHILD * v for b, v in adult.items()})
    root = RigidTransform.fit(child.bones["capitate"].vertices / 0.6, template.bones["capitate"].vertices)
    assert root.translation == pytest.approx(0, abs=1e-2)
    for name, bone in child.bones.items():
        assert bone.vertices == pytest.approx(0.6 * template.bones[name].vertices, abs=0.05), name
    for a, b in zip(child.joints, template.joints, strict=True):
        assert a.centre == pytest.approx(0.6 * b.centre, abs=0.05)
        assert a.axes == pytest.approx(b.axes, abs=1e-3)


def test_one_finger_grows_alone(template):
    own = family.lengths_of(template)
    wanted = own | {"proximal4": own["proximal4"] + 8}
    points = family.target_points(template, wanted, scale=1.0)
    moved = {n: float(np.linalg.norm(p - template.feature_points[n])) for n, p in points.items()}
    for name in ("PIP4", "DIP4", "tip4"):
        assert moved[name] == pytest.approx(8, abs=1.5), name
    for name in ("tip2", "PIP2", "MP2", "tip1", "MP5", "PIP5", "tip5"):
        assert moved[name] < 0.8, name


def test_palm_and_girth_follow_the_scale(template):
    grown = family.resized(template, family.lengths_of(template), scale=1.1)
    width = [
        np.linalg.norm(t.bones["trapezoid"].centroid() - t.bones["hamate"].centroid())
        for t in (grown, template)
    ]
    assert width[0] / width[1] == pytest.approx(1.1, abs=0.03)
    for bone in ("proximal2", "middle3", "metacarpal4"):
        assert surface_box(grown.bones[bone])[1] / surface_box(template.bones[bone])[1] == pytest.approx(
            1.1, abs=0.03
        )


def test_a_mirrored_template_grows_alike(template):
    wanted = family.sized(0.9)
    right, left = family.resized(template, wanted), family.resized(template.mirrored(), wanted)
    assert left.side == "left"
    for name, bone in left.bones.items():
        assert bone.vertices == pytest.approx(right.bones[name].vertices * [1, -1, 1], abs=0.3), name


@pytest.mark.parametrize(
    ("lengths", "match"),
    [({"proximal2": 4.0}, "proximal2: 4 mm"), ({"capitate": 20.0}, "capitate: is no long bone")],
)
def test_impossible_lengths_are_refused(template, lengths, match):
    with pytest.raises(InputError, match=match):
        family.family_warp(template, lengths)


def test_unlike_fingers_stay_invertible_and_impossible_ones_are_refused(template):
    def unlike(share):
        signs = {b: 1 if b[-1] in "24" else -1 for b in family.MEDIAN_MALE}
        return {b: v * (1 + share * signs[b]) for b, v in family.lengths_of(template).items()}

    assert family.resized(template, unlike(0.08)).bones["distal2"].is_closed()
    with pytest.raises(InputError, match="inside out, most at"):
        family.resized(template, unlike(0.25))
