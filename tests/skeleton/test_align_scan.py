"""The stage that aligns a scan, on an image of the phantom finger, with the rig of its true bones."""

import numpy as np
import pytest
from benchmarks.scans.alignment import bent, displaced, finger_scan, settled

from handpipe.core import InputError, metrics
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.mesh.files import read_scan, write_surface
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.skeleton.align_scan import Inputs, Outputs, align_scan
from handpipe.synthetic.phantom.phantom_finger import finger, generate_pose, posture

POSE = "curl"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """The phantom finger with one image and a rig."""
    root = tmp_path_factory.mktemp("finger")
    found = load_dataset("config/datasets/phantom-finger.yaml").model_copy(update={"root": root})
    generate_pose(found, POSE)
    poses = ("neutral", "bow", "hook", POSE)
    transforms = {pose: posture(pose, found.seed).transforms() for pose in poses}
    bones = {name: Surface(*surface) for name, surface in finger().bones.items()}
    Rig.fit(found, transforms, bones, poses).save(root / "rig.h5")
    return found


def run(dataset: Dataset, scan: Surface) -> Outputs:
    root = dataset.root
    write_surface(root / "own.ply", scan)
    outputs = Outputs(root / "aligned.ply", root / "metrics.json")
    for path in outputs.all():
        path.unlink(missing_ok=True)
    volume = dataset.path(dataset.poses[POSE].volume)
    align_scan(Inputs(root / "own.ply", volume, root / "rig.h5"), outputs, dataset, POSE)
    return outputs


def test_a_displaced_scan_takes_its_place_in_the_volume(dataset):
    rng = np.random.default_rng(21)
    known = posture(POSE, dataset.seed)
    scan = displaced(finger_scan(settled(known, rng), rng), rng)
    outputs = run(dataset, scan)
    aligned = read_scan(outputs.scan)
    true = Surface(*finger().posed(known).skin)
    assert Distance(true).closest(scan.vertices)[0].mean() > 3.0
    assert Distance(true).closest(aligned.vertices)[0].mean() < 0.15
    figures = metrics.read(outputs.metrics)
    assert figures["shift"][1] == "mm"
    assert 5.0 < figures["rotation"][0] < 25.0
    assert {"turn_MP2", "turn_PIP2", "turn_DIP2", "distance", "volume_ratio", "seconds"} <= set(figures)


def test_a_scan_of_another_pose_is_refused_and_nothing_is_written(dataset):
    rng = np.random.default_rng(22)
    scan = finger_scan(bent(posture(POSE, dataset.seed), {"PIP2_flexion": -40.0}), rng)
    with pytest.raises(InputError, match=r"own\.ply"):
        run(dataset, scan)
    assert not (dataset.root / "aligned.ply").exists()
