"""The template hand of the project on a coarser mesh: muscles whole, in their places, attached, sound."""

from pathlib import Path

import numpy as np
import pytest

from handpipe.anatomy.templates.curves import place
from handpipe.anatomy.templates.hand import HandFile, HandTemplate, build_hand, load_hand
from handpipe.core.errors import InputError
from handpipe.fem.linear.factorisation import factorise
from handpipe.mesh.surfaces.distance import Distance
from handpipe.synthetic.template_hands.template_hand import bare_hand

FILE = Path(__file__).parents[2] / "config/anatomy/hand.yaml"
DORSAL = [f"dorsal_interosseous{i}" for i in range(1, 5)]
PALMAR = [f"palmar_interosseous{i}" for i in range(1, 4)]
LUMBRICALS = [f"lumbrical{i}" for i in range(1, 5)]


@pytest.fixture(scope="module")
def file() -> HandFile:
    return load_hand(FILE)


@pytest.fixture(scope="module")
def hand(file: HandFile) -> HandTemplate:
    """Without volumes to meet, which takes minutes, and without ligaments, which want finer tets."""
    muscles = {name: muscle.model_copy(update={"volume": None}) for name, muscle in file.muscles.items()}
    quick = file.model_copy(update={"muscles": muscles, "ligaments": {}})
    return build_hand(quick, bare_hand(1.8, 3.5), 6.0, factorise=factorise, source=FILE)


def test_everything_is_there_and_sound(hand: HandTemplate) -> None:
    metrics = {name: value for name, (value, _) in hand.metrics().items()}
    counts = {"muscles": 17, "tendons": 10, "bones": 23, "nails": 5}
    assert {name: metrics[name] for name in counts} == counts
    assert metrics["intersections"] == 0 and metrics["inverted"] == 0 and metrics["manifold"] == 1
    assert metrics["smallest_dihedral"] >= 5
    assert all(len(muscle.surface.components()) == 1 for muscle in hand.subject.muscles.values())
    assert metrics["least_fat"] >= 0.5
    mesh, bare = hand.tissue.mesh, hand.subject
    assert bare.skin is not None
    room = bare.skin.volume() - sum(bone.volume() for bone in bare.bones.values())
    np.testing.assert_allclose(mesh.volumes().sum(), room, rtol=1e-6)


def test_muscles_are_attached_where_the_file_says(hand: HandTemplate, file: HandFile) -> None:
    """Each touches the bones on which its curves begin and end; a lumbrical begins on no bone."""
    for name, muscle in file.muscles.items():
        organ = hand.subject.muscles[name]
        first = {c.points[0].bone for c in muscle.curves if not name.startswith("lumbrical")}
        last = {c.points[-1].bone for c in muscle.curves if not name.startswith("lumbrical")}
        assert first | last <= set(organ.attachments), name
    placed = place(file.curves(), hand.subject.bones, 1.0)
    for name in LUMBRICALS:
        organ = hand.subject.muscles[name]
        for end in (placed[name].curves[0].points[0], placed[name].curves[0].points[-1]):
            assert np.linalg.norm(organ.surface.vertices - end, axis=1).min() < 3.0


def test_order_across_the_palm(hand: HandTemplate) -> None:
    """From the thumb's side outwards; dorsal interossei are dorsal of the palmar ones, lumbricals palmar."""
    middle = {name: muscle.surface.centroid() for name, muscle in hand.subject.muscles.items()}
    for group in (DORSAL, PALMAR, LUMBRICALS):
        radial = [middle[name][1] for name in group]
        assert radial == sorted(radial, reverse=True)
    for dorsal, palmar in zip(DORSAL[1:], PALMAR, strict=True):
        assert middle[dorsal][2] > middle[palmar][2] + 2
    for palmar, lumbrical in zip(PALMAR, LUMBRICALS[1:], strict=True):
        assert middle[palmar][2] > middle[lumbrical][2] + 2


def test_fibres_run_from_origin_to_insertion(hand: HandTemplate) -> None:
    for name in (*DORSAL, *PALMAR, *LUMBRICALS):
        muscle = hand.subject.muscles[name]
        assert muscle.fibres is not None and muscle.mesh is not None
        assert np.average(muscle.fibres[:, 0], weights=muscle.mesh.volumes()) > 0.7, name


def test_tendons_pass_along_bones_and_inside_of_the_skin(hand: HandTemplate) -> None:
    assert hand.subject.skin is not None
    skin = Distance(hand.subject.skin)
    for name, tendon in hand.subject.tendons.items():
        assert skin.signed(tendon.path)[0].max() < 0, name
        for bone in tendon.bones:
            depth = Distance(hand.subject.bones[bone]).signed(tendon.path[3:])[0].min()
            assert depth > -0.5, (name, bone, depth)


def test_nails_are_over_their_bones(hand: HandTemplate) -> None:
    assert hand.subject.skin is not None
    for bone, triangles in hand.subject.nails.items():
        patch = hand.subject.skin.vertices[hand.subject.skin.triangles[triangles]].reshape(-1, 3)
        assert Distance(hand.subject.bones[bone]).closest(patch)[0].max() < 7.0


def test_mistakes_are_named(file: HandFile) -> None:
    content = file.model_dump(exclude_none=True, exclude_unset=True)
    content["ligaments"]["lumbrical1"] = content["ligaments"]["collateral_radial1"]
    with pytest.raises(ValueError, match=r"ligaments.lumbrical1: is a muscle's name"):
        HandFile.model_validate(content)
    bare = bare_hand(3.0, 5.0)
    with pytest.raises(InputError, match="skin"):
        build_hand(file, type(bare)("right", bare.bones), 6.0)
