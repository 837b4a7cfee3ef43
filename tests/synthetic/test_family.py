"""Generated hands of measured people have their measures and are sound; the median hand is unchanged."""

import hashlib
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from handpipe.anatomy.person import SubjectTemplate, lengths_of, scaled
from handpipe.anatomy.templates import HandFile, load_hand, sunken
from handpipe.core import Array
from handpipe.core.configuration.dataset import load_dataset
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.synthetic.acquisition.posed import PosedAnatomy
from handpipe.synthetic.family.measured_people import PEOPLE
from handpipe.synthetic.family.proportions import build_of
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.hand_skin import skin_surface
from handpipe.synthetic.phantom.phantom_hand_joints import joints
from handpipe.synthetic.template_hands.coupled_hand import bones_at, mirrored
from handpipe.synthetic.template_hands.hand_templates import phantom
from handpipe.synthetic.template_hands.known_hands import known_hand
from handpipe.synthetic.template_hands.template_hand import of_build

CONFIG = Path(__file__).parents[2] / "config"
DATASETS, CURVES = CONFIG / "datasets", CONFIG / "anatomy" / "hand.yaml"
HANDS = {"hand-" + name: name for name in PEOPLE}
# Of the median hand's bones, marrow, joints and posed tissues, before hands had proportions.
DIGEST = "209fb4b7e1e9da86b5df034038a3cb1ddc10e4c435099c157092338c4934386d"
NAIL = np.arange(3)  # some triangles
HEIGHTS = np.linspace(-8.0, 4.0, 7)  # mm above the knuckles' middles, of an adult, at which breadth is tried
ADULT = 69.0  # mm: length of the third metacarpal of the hand that these heights are of
LENGTH, ACROSS = 2.0, 2.0  # mm that a measure on the surfaces may differ from the table


def hand_measures(hand: SubjectTemplate) -> dict[str, float]:
    """Lengths of the long bones, breadth and thickness at the knuckles.

    Parameters
    ----------
    hand : SubjectTemplate
        Right hand in neutral with bones, joints and skin: +x distal, +y radial, +z dorsal, in mm.

    Returns
    -------
    dict of str to float
        mm by bone; "breadth": the widest at the heads of metacarpals II and V, "thickness": at that of III.
    """
    assert hand.skin is not None
    found = lengths_of(hand)
    centres = {joint.name: joint.centre for joint in hand.joints}
    first, last = centres["MP2"], centres["MP5"]
    across, up = first - last, np.array([0.0, 0.0, 1.0])
    apart = float(np.linalg.norm(across))
    places = found["metacarpal3"] / ADULT * HEIGHTS[:, None] * up
    radial = _outwards(hand.skin, first + places, across / apart)
    ulnar = _outwards(hand.skin, last + places, -across / apart)
    middle = centres["MP3"][None]
    thickness = _outwards(hand.skin, middle, up) + _outwards(hand.skin, middle, -up)
    return {**found, "breadth": float(apart + (radial + ulnar).max()), "thickness": float(thickness[0])}


def _outwards(skin: Surface, points: Array, direction: Array) -> Array:
    """Mm (n,) from points (n, 3) inside a skin to where a direction (3,) first leaves it."""
    mesh = trimesh.Trimesh(skin.vertices, skin.triangles, process=False)
    places, rays, _ = mesh.ray.intersects_location(points, np.tile(direction, (len(points), 1)))
    along = (places - points[rays]) @ direction
    return np.array([along[rays == number].min() for number in range(len(points))])


@pytest.fixture(scope="module", params=HANDS)
def hand(request: pytest.FixtureRequest) -> tuple[str, SubjectTemplate]:
    """A hand's name, and its bones, joints and skin at its size."""
    build = build_of(HANDS[request.param])
    skin = skin_surface(phantom_hand.layout(build), 3.5)
    skin = skin.moved(build.size * build.shaped(skin.vertices))
    return request.param, replace(phantom(build), skin=skin)


def test_bones_and_breadth_have_the_measured_size(hand: tuple[str, SubjectTemplate]) -> None:
    name, subject = hand
    person, build, found = PEOPLE[HANDS[name]], build_of(HANDS[name]), hand_measures(subject)
    assert found["breadth"] == pytest.approx(person.breadth, abs=ACROSS)
    if person.thickness is not None:
        assert found["thickness"] == pytest.approx(person.thickness, abs=ACROSS)
    for bone, length in build.lengths.items():
        assert found[bone] == pytest.approx(length, abs=LENGTH), bone
    # Of the person's own measures, without the table of bones: the chain of the middle finger and its palm.
    finger = sum(found[f"{kind}3"] for kind in ("proximal", "middle", "distal"))
    median = 44.0 + 24.0 + 17.0  # mm, of the man whose finger is 76.8 mm long from its crease
    assert finger / median == pytest.approx((person.length - person.palm) / 76.82, rel=0.03)


def test_bones_lie_inside_the_skin_and_apart(hand: tuple[str, SubjectTemplate]) -> None:
    name, subject = hand
    size = build_of(HANDS[name]).size
    assert subject.skin is not None
    assert subject.skin.is_closed()
    skin = trimesh.Trimesh(subject.skin.vertices, subject.skin.triangles, process=False)
    assert skin.euler_number == 2  # no bridge between two fingers
    distance = Distance(subject.skin)
    for bone, surface in subject.bones.items():
        assert skin.contains(surface.vertices[::7]).all(), bone
        assert distance.closest(surface.vertices)[0].min() > 1.2 * size, bone
    for a, b in combinations(subject.bones, 2):
        one, other = subject.bones[a], subject.bones[b]
        near = cKDTree(one.vertices).query(other.vertices)[0]
        assert near.min() > 0.2, (a, b)
        assert not trimesh.Trimesh(one.vertices, one.triangles).contains(other.vertices[near < 3.0]).any()


def test_poses_are_of_this_hand_within_its_limits_and_leave_room(hand: tuple[str, SubjectTemplate]) -> None:
    name, subject = hand
    dataset = load_dataset(DATASETS / f"{name}.yaml")
    known, median = known_hand(dataset), known_hand(load_dataset(DATASETS / "phantom-hand-complete.yaml"))
    limits = {a: b for j in dataset.joints.values() for a, b in zip(j.angles, j.limits_deg, strict=True)}
    for pose in dataset.poses:
        angles = known.motion.poses[pose]
        assert all(limits[a][0] <= value <= limits[a][1] for a, value in angles.items()), pose
        assert (angles == median.motion.poses[pose]) == (pose == "neutral")
        moves = bones_at(known.motion, pose)
        fingers = {
            bone: cKDTree(moves[bone](surface.vertices))
            for bone, surface in subject.bones.items()
            if bone[-1] in "2345" and not bone.startswith("metacarpal")
        }
        for a, b in combinations(fingers, 2):
            if a[-1] != b[-1]:
                assert fingers[a].query(fingers[b].data)[0].min() > 3.0 * known.size, (pose, a, b)


def test_hands_differ_in_more_than_size() -> None:
    """Axes lean by degrees, centres lie elsewhere: the median hand made larger has neither."""
    median = {joint.name: joint for joint in joints()}
    for name in PEOPLE:
        build = build_of(name)
        leaning = [
            np.degrees(np.arccos(np.clip(abs(joint.axes[0] @ median[joint.name].axes[0]), 0.0, 1.0)))
            for joint in joints(build)
        ]
        assert 0.5 < np.mean(leaning) < 6.0
    assert len({build_of(name).girth("proximal2") for name in PEOPLE}) == len(PEOPLE)


def test_the_median_hand_is_what_it_was() -> None:
    """Rounded to 0.1 um: libraries differ in the last digits, and nothing of a subject may move by more."""
    digest = hashlib.sha256()

    def add(values: Array) -> None:
        digest.update((np.round(values, 4) + 0.0).tobytes())

    known = phantom_hand.hand()
    for surfaces in (known.bones, known.marrow):
        for bone, (vertices, triangles) in surfaces.items():
            digest.update(bone.encode() + triangles.tobytes())
            add(vertices)
    for joint in joints():
        add(np.vstack([joint.axes, joint.centre, joint.residual_rotation, joint.residual_translation]))
    for rows in vars(known.posed(phantom_hand.posture("relaxed", 1)).tissues).values():
        add(rows)
    assert digest.hexdigest() == DIGEST


def test_no_muscle_runs_inside_a_bone_between_two_points_on_it(hand: tuple[str, SubjectTemplate]) -> None:
    """No tissue is kept inside of a bone: the muscle would end before its insertion."""
    name, known = hand
    build = build_of(HANDS[name])
    bones = scaled(known, 1.0 / build.size).bones

    def deepest(file: HandFile) -> float:
        curves = [curve for organ in file.muscles.values() for curve in organ.curves]
        return float(max(sunken(c.points, bones, file.distal, name, "curve").max() for c in curves))

    file = load_hand(CURVES)
    assert deepest(of_build(file, build, bones)) < 0.3
    if name == "hand-long-fingers":  # its first metacarpal is 0.82 as long as the median at the median size
        assert deepest(file) > 0.45


def test_unknown_proportions_are_refused() -> None:
    with pytest.raises(InputError, match="no measured person"):
        build_of("giant")


def test_a_left_hand_moves_as_the_mirror_image_of_a_right_one() -> None:
    """Its joints carry its bones to where its truth has them, and its surfaces face outwards still."""
    posture = phantom_hand.posture("relaxed", 1)
    right = phantom_hand.hand().posed(posture)
    skin = right.bones["distal2"]
    whole = PosedAnatomy(
        posture,
        right.transforms,
        right.bones,
        right.marrow,
        {},
        {},
        {},
        {},
        {},
        skin,
        {"distal2": (NAIL, posture.root)},
    )
    left = mirrored(whole)
    for bone, moved in left.posture.transforms().items():
        np.testing.assert_allclose(moved.rotation, left.transforms[bone].rotation, atol=1e-12)
        np.testing.assert_allclose(moved.translation, left.transforms[bone].translation, atol=1e-9)
    for bone, surface in left.bones.items():
        assert Surface(*surface).volume() == pytest.approx(Surface(*right.bones[bone]).volume())
        np.testing.assert_array_equal(surface[0] * [1, -1, 1], right.bones[bone][0])
    assert left.posture.angles == posture.angles


def test_tendons_are_stated_as_thick_as_they_are_generated() -> None:
    """The fit takes their radii from the dataset file."""
    median = load_dataset(DATASETS / "phantom-hand-complete.yaml").tendons
    for name, person in HANDS.items():
        for tendon, stated in load_dataset(DATASETS / f"{name}.yaml").tendons.items():
            grown = build_of(person).size * median[tendon].radius
            assert stated.radius == pytest.approx(grown, abs=0.06), (name, tendon)
