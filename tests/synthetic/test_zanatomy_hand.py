"""Z-Anatomy's hand with its organs, where the source is at hand: a coarse template, and what it lists."""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from handpipe.anatomy.templates import solids
from handpipe.core.configuration.dataset import Dataset, load_dataset
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.distance import Distance
from handpipe.stages.synthetic import zanatomy_hand as stage
from handpipe.synthetic.template_hands import zanatomy_hand, zanatomy_organs
from handpipe.synthetic.template_hands.known_hands import known_hand

CHECKOUT = Path(__file__).parents[2]
CONFIG = CHECKOUT / "config/datasets/zanatomy-hand.yaml"
EDGES = {"bone": 1.8, "skin": 3.5, "fat": 6}  # mm


@contextmanager
def reads() -> Iterator[set[Path]]:
    """The files that Python opens to read while this is open."""
    found: set[Path] = set()
    watching = True

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if watching and event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            path, mode, flags = arguments
            if "r" in mode or "+" in mode if isinstance(mode, str) else not flags & os.O_WRONLY:
                found.add(Path(os.path.abspath(os.fsdecode(path))))

    sys.addaudithook(hook)  # stays for good
    try:
        yield found
    finally:
        watching = False


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    found = load_dataset(CONFIG)
    assert found.anatomy is not None
    folder = (CONFIG.parents[2] / found.anatomy).resolve()
    if not folder.exists():
        pytest.skip("the source anatomy is not on this machine")
    return found.model_copy(update={"anatomy": folder})


@pytest.fixture(scope="module")
def made(
    dataset: Dataset, tmp_path_factory: pytest.TempPathFactory
) -> tuple[zanatomy_hand.RealHand, set[Path], stage.Outputs]:
    """What the stage makes, the files that it reads and those that it writes.

    Coarser than by the rules: thin ends are lost that these keep.
    """
    folder, built = tmp_path_factory.mktemp("real"), []
    outputs = stage.Outputs(*(folder / name for name in ("t.h5", "s.h5", "metrics.json", "repairs.json")))
    build = zanatomy_hand.build
    with pytest.MonkeyPatch.context() as patch, reads() as read:
        patch.setattr(solids, "FINEST", 2.0)
        patch.setattr(zanatomy_hand, "build", lambda *a, **k: built.append(build(*a, **k)) or built[0])
        stage.zanatomy_hand(outputs, dataset, EDGES)
    return built[0], read, outputs


@pytest.fixture(scope="module")
def hand(made: tuple[zanatomy_hand.RealHand, set[Path], stage.Outputs]) -> zanatomy_hand.RealHand:
    return made[0]


def test_the_stage_reads_the_folder_that_the_dataset_names(
    made: tuple[zanatomy_hand.RealHand, set[Path], stage.Outputs], dataset: Dataset
) -> None:
    """Of the project and of the data beside it; the rule declares that field, and no file."""
    _, read, outputs = made
    assert dataset.anatomy is not None
    given = {path for path in read if path.is_relative_to(dataset.anatomy)}
    assert len(given) > 30
    code = [path for path in read if path.suffix == ".py" or "__pycache__" in path.parts]
    near = [path for path in read if any(path.is_relative_to(f) for f in (CHECKOUT, dataset.anatomy.parent))]
    assert set(near) <= given | set(code)
    assert all(path.stat().st_size > 0 for path in outputs.all())


def test_a_missing_source_is_named() -> None:
    found = load_dataset(CONFIG).model_copy(update={"anatomy": Path("nowhere")})
    with pytest.raises(InputError, match="nowhere does not exist"):
        known_hand(found)


def test_everything_is_there_and_sound(hand: zanatomy_hand.RealHand) -> None:
    metrics = {name: value for name, (value, _) in hand.template.metrics().items()}
    counts = {"muscles": 15, "ligaments": 0, "tendons": 10, "bones": 23, "nails": 5}
    assert {name: metrics[name] for name in counts} == counts
    assert metrics["intersections"] == 0 and metrics["inverted"] == 0 and metrics["manifold"] == 1
    assert metrics["smallest_dihedral"] > 3 and metrics["least_fat"] > 1


def test_the_dataset_names_what_is_there(hand: zanatomy_hand.RealHand, dataset: Dataset) -> None:
    subject = hand.template.subject
    assert set(dataset.muscles) == set(subject.muscles) and set(dataset.bones) == set(subject.bones)
    for name, tendon in subject.tendons.items():
        given = dataset.tendons[name]
        assert tuple(given.bones) == tendon.bones
        assert given.radius == pytest.approx(tendon.radius, abs=0.15)


def test_muscles_keep_their_volumes(hand: zanatomy_hand.RealHand, dataset: Dataset) -> None:
    """The manifest of the source says what closed meshes hold.

    By the rules' tets every muscle keeps 0.9 of it; by these the thinnest, lumbrical I, keeps about half.
    """
    assert dataset.anatomy is not None
    manifest = json.loads((dataset.anatomy / "zanatomy_right_hand/manifest.json").read_text(encoding="utf-8"))
    rows = {(row["organ"], row["what"]): float(row["value"]) for row in hand.repairs}
    for name, group in zanatomy_organs.GROUPS.items():
        known = [manifest[file]["volume_mm3"] for file in group.files]
        if group.body is None and None not in known:
            assert rows[name, "source"] == pytest.approx(sum(known), rel=0.02)
        assert rows[name, "mesh"] > 0.4 * rows[name, "source"], name
        assert rows[name, "in_bones"] + rows[name, "in_organs"] < 0.05 * rows[name, "source"], name


def test_muscles_lie_across_the_hand_in_order(hand: zanatomy_hand.RealHand) -> None:
    middle = {name: muscle.surface.centroid() for name, muscle in hand.template.subject.muscles.items()}
    for group in ("dorsal_interosseous", "lumbrical"):
        radial = [middle[f"{group}{i}"][1] for i in range(1, 5)]
        assert radial == sorted(radial, reverse=True)
    for i in range(2, 5):
        assert middle[f"dorsal_interosseous{i}"][2] > middle[f"lumbrical{i}"][2] + 2


def test_organs_are_attached_to_the_bones_of_their_ends(hand: zanatomy_hand.RealHand) -> None:
    for name, muscle in hand.template.subject.muscles.items():
        group = zanatomy_organs.GROUPS[name]
        assert set(muscle.attachments) == set(group.origin) | set(group.insertion)


def test_all_changes_are_listed(hand: zanatomy_hand.RealHand) -> None:
    organs = {str(row["organ"]) for row in hand.repairs}
    subject = hand.template.subject
    assert organs == {*subject.bones, *subject.muscles, *zanatomy_organs.ABSENT, "skin"}
    assert all(np.isfinite(float(row["value"])) and row["unit"] in ("mm^3", "1") for row in hand.repairs)
    opened = [row["organ"] for row in hand.repairs if row["what"] == "open_edges" and row["value"]]
    assert opened == ["adductor_pollicis"]


def test_tendons_are_inside_of_the_skin_and_outside_of_bones(hand: zanatomy_hand.RealHand) -> None:
    subject = hand.template.subject
    assert subject.skin is not None
    skin = Distance(subject.skin)
    for tendon in subject.tendons.values():
        assert skin.signed(tendon.path)[0].max() < -1.5
        for bone in tendon.bones:
            assert Distance(subject.bones[bone]).signed(tendon.path)[0].min() > -0.5
