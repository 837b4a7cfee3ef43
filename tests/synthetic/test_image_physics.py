"""The physical image model against signal equations, Fourier analysis and the statistics of noise."""

import math
from pathlib import Path

import nibabel
import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_erosion

from handpipe.core.configuration import Dataset, Images, load_dataset
from handpipe.synthetic.acquisition.image import VoxelGrid, occupancy
from handpipe.synthetic.acquisition.physics import fields, kspace, receive
from handpipe.synthetic.acquisition.physics.anatomy import ImagedAnatomy
from handpipe.synthetic.acquisition.physics.effects import AMOUNTS, EFFECTS, Effects
from handpipe.synthetic.acquisition.physics.relaxation import TISSUES, Times, TissueSignal
from handpipe.synthetic.acquisition.physics.scanner import scan
from handpipe.synthetic.acquisition.physics.sequences import FAT_SHIFT, Sequence, frequency
from handpipe.synthetic.phantom import phantom_finger

GRID = VoxelGrid((64, 64, 4), np.zeros(3), 0.5)
ONE_PEAK = ((FAT_SHIFT, 1.0),)
SPIN_ECHO = Sequence.named("spin_echo", 3.0)


def imaged(share: np.ndarray, tissue: str = "marrow", seed: int = 1, sequence=SPIN_ECHO, **strengths: str):
    """Magnitudes of one tissue in air, in units of that tissue's signal, whatever the gain."""
    effects, palm = Effects(strengths), np.array([0.0, 0.0, -1.0])
    anatomy = ImagedAnatomy([(tissue, share)], [], palm)
    gain = scan(
        ImagedAnatomy([("marrow", np.ones(GRID.shape))], [], palm), GRID, SPIN_ECHO, Effects({}), [seed]
    )
    level = abs(sum(sequence.signal(TISSUES[tissue]))) / abs(sum(SPIN_ECHO.signal(TISSUES["marrow"])))
    scale = float(gain.mean()) * level * SPIN_ECHO.reference / sequence.reference
    return scan(anatomy, GRID, sequence, effects, [seed]) / scale


def block(axis: int, start: int, stop: int) -> np.ndarray:
    share = np.zeros(GRID.shape)
    share[tuple(slice(start, stop) if a == axis else slice(None) for a in range(3))] = 1.0
    return share


def test_spin_echo_of_a_tissue_is_its_equation() -> None:
    tissue = TissueSignal(0.7, 0.3, Times(900, 60, 20), Times(1200, 40, 10))
    water, fat = Sequence(3.0, 1500.0, 26.0).signal(tissue)
    assert abs(water + fat) == pytest.approx(0.7 * (1 - math.exp(-1500 / 1200)) * math.exp(-26 / 40))
    assert abs(fat) / abs(water) == pytest.approx(3 / 7)


def test_spoiled_gradient_echo_is_largest_at_the_ernst_angle() -> None:
    tissue = TissueSignal(1.0, 0.0, Times(900, 60, 20), Times(1200, 40, 10))
    angles = np.linspace(1.0, 40.0, 3901)
    best = angles[np.argmax([abs(Sequence(1.5, 23.0, 4.6, a).signal(tissue)[0]) for a in angles])]
    assert best == pytest.approx(math.degrees(math.acos(math.exp(-23 / 900))), abs=0.02)


@pytest.mark.parametrize(("echo", "expected"), [(1.5, 0.0), (2.0, 1.0)])
@pytest.mark.parametrize("field", [1.5, 3.0])
def test_half_fat_half_water_cancels_where_opposed(echo: float, expected: float, field: float) -> None:
    time = echo * 1e3 / abs(frequency(field))
    tissue = TissueSignal(1.0, 0.5, *(Times(800, 1e9, 1e9),) * 2)
    water, fat = Sequence(field, 23.0, time, 5.0, ONE_PEAK).signal(tissue)
    assert abs(water + fat) / (2 * abs(water)) == pytest.approx(expected, abs=1e-9)


def test_marrow_among_trabeculae_is_darker_than_muscle_in_gradient_echoes_alone() -> None:
    for name in ("gradient_echo_in_phase", "gradient_echo_opposed"):
        sequence = Sequence.named(name, 3.0)
        marrow, muscle = (abs(sum(sequence.signal(TISSUES[t]))) for t in ("trabeculae", "muscle"))
        assert 0.3 < marrow / muscle < 0.6  # of a real foot's and hand's: 0.42 to 0.51
    marrow, muscle = (abs(sum(SPIN_ECHO.signal(TISSUES[t]))) for t in ("trabeculae", "muscle"))
    assert marrow > 2 * muscle


@pytest.mark.parametrize("strength", ["usual", "severe"])
def test_noise_is_rician(strength: str) -> None:
    amount = getattr(AMOUNTS["noise"], strength)
    air = imaged(np.zeros(GRID.shape), noise=strength)
    assert air.mean() == pytest.approx(amount * math.sqrt(math.pi / 2), rel=0.02)
    assert air.std() == pytest.approx(amount * math.sqrt(2 - math.pi / 2), rel=0.02)
    full = imaged(np.ones(GRID.shape), noise=strength)
    assert full.std() == pytest.approx(amount, rel=0.03)
    assert full.mean() == pytest.approx(1 + amount**2 / 2, abs=4 * amount / math.sqrt(full.size))


def test_fat_moves_along_the_readout_by_its_frequency_over_the_bandwidth() -> None:
    sequence = Sequence(3.0, 1500.0, 25.93, None, ONE_PEAK)
    fat, muscle = block(0, 20, 40), block(0, 20, 40)
    for share, tissue, part in ((fat, "fat", TISSUES["fat"].fat), (muscle, "muscle", TISSUES["muscle"].fat)):
        moved = imaged(share, tissue, sequence=sequence, chemical_shift="severe")
        middle = np.arange(64) @ moved.mean(axis=(1, 2)) / moved.mean(axis=(1, 2)).sum()
        expected = 29.5 - part * 3.4 * 42.577 * 3.0 / 220.0
        assert middle == pytest.approx(expected, abs=0.06)


def test_truncation_overshoots_an_edge_by_nine_percent() -> None:
    """Wilbraham's constant: the overshoot of a step is 8.949 % of it."""
    k = np.fft.fft(np.repeat([0.0, 1.0, 0.0], [512, 1024, 512]))
    k[np.abs(np.fft.fftfreq(2048)) > 1 / 32] = 0
    assert np.fft.ifft(k).real.max() - 1 == pytest.approx(0.0895, abs=0.002)
    edge = imaged(block(1, 20, 44), gibbs="severe")
    assert 0.05 < edge.max() - 1 < 0.12
    assert imaged(block(1, 20, 44)).max() == pytest.approx(1.0, abs=1e-4)


def test_what_folds_in_is_the_subject_moved_along_the_phase_direction() -> None:
    share = block(1, 4, 14)
    folded = imaged(share, wrap="severe")
    place = round(kspace.NEIGHBOUR * 64)
    expected = share + 0.5 * np.roll(share, place, axis=1)
    np.testing.assert_allclose(folded, expected, atol=1e-3)
    turned = imaged(np.roll(share, 50, axis=1), wrap="severe")
    np.testing.assert_allclose(turned, np.roll(folded, 50, axis=1), atol=1e-3)


def test_ghosts_keep_energy_and_leave_the_subject_along_the_phase_direction_alone() -> None:
    share = block(0, 20, 40) * block(1, 24, 40)
    still, swung = imaged(share), imaged(share, ghosts="severe")
    assert (swung**2).sum() == pytest.approx((still**2).sum(), rel=1e-3)
    assert swung[:15].max() < 1e-3
    assert swung[25:35, :15].max() > 0.01


def test_the_coil_falls_from_one_to_its_share() -> None:
    found = receive.coil_sensitivity(GRID, 0.2, np.random.default_rng(3))
    assert found.max() == pytest.approx(1.0)
    assert found.min() == pytest.approx(0.2, rel=1e-4)


def test_distortion_keeps_the_signal() -> None:
    shift = receive.field_shift(VoxelGrid((64, 64, 8), np.zeros(3), 0.5), 1.5, np.random.default_rng(2))
    assert np.abs(shift).max() == pytest.approx(1.5, rel=1e-5)
    image = np.zeros(shift.shape, np.float32)
    image[20:44, 20:44] = 1.0
    assert receive.distorted(image, shift).sum() == pytest.approx(image.sum(), rel=5e-3)


def test_slices_average_and_profiles_have_their_width() -> None:
    weights = receive.slices(12, 3.0)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose((weights @ np.arange(12.0))[2:10], np.arange(2.0, 10.0), atol=1e-12)
    row = receive.profile(101, 6.0)[50]
    assert row[53] / row[50] == pytest.approx(0.5)


def test_strands_and_sheets_hold_their_volume() -> None:
    x = np.abs(np.arange(-5.0, 5.0, 0.5) + 0.13)
    assert fields.sheet(x, 0.3, 0.5).sum() * 0.5 == pytest.approx(0.3, rel=0.01)
    y, z = np.meshgrid(*(np.arange(-5.0, 5.0, 0.5) + 0.13,) * 2)
    assert fields.strand(np.hypot(y, z), 1.5, 0.5).sum() * 0.25 == pytest.approx(np.pi * 1.5**2, rel=0.02)


def test_one_seed_one_image_and_each_effect_its_own_stream() -> None:
    share = block(0, 10, 50)
    first = imaged(share, noise="usual", septa="usual")
    np.testing.assert_array_equal(first, imaged(share, noise="usual", septa="usual"))
    assert np.abs(first - imaged(share, seed=2, noise="usual", septa="usual")).max() > 0.01
    quiet, noise = imaged(share), imaged(share, noise="usual")
    coil = imaged(share, noise="usual", coil="usual")
    outside = share == 0
    np.testing.assert_allclose(noise[outside], coil[outside], atol=1e-5)
    assert np.abs(noise - quiet).max() > 0.01


@pytest.mark.parametrize("effect", EFFECTS)
def test_amounts_grow_worse(effect: str) -> None:
    amount = AMOUNTS[effect]
    worse = amount.severe / amount.usual
    assert (worse < 1) == (effect in ("coil", "chemical_shift", "gibbs", "partial_fourier"))
    assert Effects({effect: "none"}, "usual").size(effect) is None
    assert Effects({}, "severe").size(effect) == amount.severe


def finger(root: Path, **images) -> Dataset:
    dataset = load_dataset(Path(__file__).parents[2] / "config" / "datasets" / "phantom-finger.yaml")
    return dataset.model_copy(update={"root": root, "images": Images(**images) if images else None})


def test_a_dataset_selects_the_model_and_keeps_seeds_and_truth(tmp_path) -> None:
    def made(name: str, **images) -> tuple[np.ndarray, np.ndarray, bytes]:
        found = finger(tmp_path / name, **images)
        phantom_finger.generate_pose(found, "neutral", spacing=1.2)
        files = found.poses["neutral"]
        volume, drawn = (nibabel.load(found.path(f)).get_fdata() for f in (files.volume, files.seeds))
        return volume, drawn, found.path("truth/neutral.marrow.nii.gz").read_bytes()

    absent, painted = made("absent"), made("painted", model="painted", strength="severe")
    np.testing.assert_array_equal(absent[0], painted[0])
    first = made("first", model="physics", sequence="gradient_echo_opposed")
    again = made("again", model="physics", sequence="gradient_echo_opposed")
    np.testing.assert_array_equal(first[0], again[0])
    assert first[0].shape == absent[0].shape and np.isfinite(first[0]).all()
    assert np.corrcoef(first[0].ravel(), absent[0].ravel())[0, 1] < 0.97
    assert first[2] == absent[2]
    assert set(np.unique(first[1])) == set(np.unique(absent[1]))
    one = made("one", model="physics", strength="none", effects={"noise": "severe"})
    assert one[0][0].min() > 0


def test_the_texture_of_marrow_moves_with_its_bone() -> None:
    """Bones turned by a right angle onto voxels again; they are round, so that their shape tells no roll."""
    grid, turn = VoxelGrid((40, 40, 40), np.full(3, -9.75), 0.5), np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    ball = trimesh.creation.icosphere(3, 4.0).apply_scale([1.1, 1.0, 1.0])
    balls = [ball.copy().apply_translation([x, 0.0, 0.0]) for x in (-4.5, 4.5)]

    def seen(turn: np.ndarray, seed: list[int]) -> np.ndarray:
        bones = [(ball.vertices @ turn.T, ball.faces) for ball in balls]
        marrow = sum(occupancy(bone, grid) for bone in bones)
        layers = [("fat", np.zeros(grid.shape)), ("marrow", marrow)]
        anatomy = ImagedAnatomy(layers, bones, np.array([0.0, 0.0, -1.0]))
        found = scan(anatomy, grid, SPIN_ECHO, Effects({"trabeculae": "usual"}), seed)
        return found / found.mean()

    first, second, other = seen(np.eye(3), [1, 2]), seen(turn, [1, 3]), seen(np.eye(3), [2, 2])
    np.testing.assert_allclose(second, np.rot90(first), atol=1e-3)
    deep = binary_erosion(first > 0.5 * first.max(), iterations=2)
    assert 0.05 < first[deep].std() / first[deep].mean() < 0.15
    left, right = (part[deep[:20]] for part in (first[:20], first[20:]))  # one bone each, 9 mm apart
    for one, another in ((first[deep], other[deep]), (left, right)):  # ends are alike
        assert np.corrcoef(one, another)[0, 1] < 0.7
