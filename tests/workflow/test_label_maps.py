"""The small subject with label maps of a person in place of seeds, built by the workflow."""

from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import pytest

from handpipe.cli import main
from handpipe.imaging.volumes import write_segments

from .running import planned, run
from .small_subject import AFFINE, LABELS, RADIUS, SHAPE, distance_to
from .test_bad_input import edit

SMALL = ("--config", "subjects=[small]")


def labels(*bones: str, reach: float = RADIUS + 2) -> np.ndarray:
    """Whole bones, or with a reach of `RADIUS` their marrow; a voxel belongs to the nearer bone."""
    distances = np.stack([distance_to(bone) for bone in LABELS])
    found = np.where(distances.min(axis=0) < reach, 1 + distances.argmin(axis=0), 0)
    return np.where(np.isin(found, [LABELS[bone] for bone in bones]), found, 0).astype(np.uint8)


def give(small: Path, pose: str, found: np.ndarray, names: dict[str, int], seeds: bool = False) -> None:
    """Write a label map of a pose and name it in the dataset file, with or without the pose's seeds."""
    write_segments(small / f"small/{pose}.seg.nrrd", found, AFFINE, names)

    def change(dataset: dict[str, Any]) -> None:
        dataset["poses"][pose]["labels"] = f"{pose}.seg.nrrd"
        dataset["poses"][pose].pop("scribbles", None)
        if not seeds:
            dataset["poses"][pose].pop("seeds")

    edit(small, change)


@pytest.mark.slow
def test_label_maps_replace_seeds_in_every_pose(small: Path) -> None:
    """One pose by whole bones, the other by marrow; no seeds are read or proposed."""
    give(small, "flat", labels(*LABELS), LABELS)
    give(small, "bent", labels(*LABELS, reach=RADIUS), LABELS)
    edit(small, lambda d: d["poses"]["bent"].update(labels_show="marrow"))
    assert "propose_seeds" not in planned(small, "registration", *SMALL)
    process = run(small, "-j2", "registration", *SMALL)
    assert process.returncode == 0, process.stdout
    for pose, reach in (("flat", RADIUS + 2), ("bent", RADIUS)):
        built = np.asarray(nibabel.load(small / f"results/small/segmentation/{pose}/labels.nii.gz").dataobj)
        true = labels(*LABELS, reach=reach)
        assert built.shape == SHAPE
        for label in LABELS.values():
            both = ((built == label) & (true == label)).sum()
            assert 2 * both / ((built == label).sum() + (true == label).sum()) > 0.93


def test_seeds_are_proposed_for_the_bones_that_a_map_lacks(small: Path) -> None:
    give(small, "bent", labels("near"), {"near": 1})
    assert planned(small, "segmentation", *SMALL)["propose_seeds"] == 1
    give_all = labels(*LABELS)
    write_segments(small / "small/bent.seg.nrrd", give_all, AFFINE, LABELS)
    assert "propose_seeds" not in planned(small, "segmentation", *SMALL)


def test_a_neutral_map_that_lacks_bones_needs_seeds(small: Path) -> None:
    give(small, "flat", labels("near"), {"near": 1})
    process = run(small, "-n", "segmentation", *SMALL)
    assert process.returncode != 0
    assert "poses.flat.labels: flat.seg.nrrd lacks far, and the pose has no seeds" in process.stdout


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ({"nearest": 1, "far": 2}, "'nearest' (like near): no bone or muscle of the dataset"),
        ({"near": 1, "far": 2, "flexor": 3}, "flexor: is empty"),
    ],
)
def test_the_check_names_what_is_wrong_with_a_map(
    small: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    names: dict[str, int],
    said: str,
) -> None:
    give(small, "bent", labels(*LABELS), names, seeds=True)
    monkeypatch.chdir(small)
    assert main(["check", "small"]) == 1
    assert said in capsys.readouterr().err
    write_segments(small / "small/bent.seg.nrrd", labels(*LABELS), AFFINE, LABELS)
    assert main(["check", "small"]) == 0
    edit(small, lambda d: d["poses"]["bent"].update(labels_show="marrow"))
    assert main(["check", "small"]) == 1
    assert "Write `labels_show: whole` beside `labels`" in capsys.readouterr().err
