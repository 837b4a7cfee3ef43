"""Fat and water from echoes: known fat, water and field are found again; real images of a hand."""

from pathlib import Path

import nibabel
import numpy as np
import pytest
from scipy import ndimage

from handpipe.core import HandpipeError, InputError, metrics
from handpipe.core.configuration.dataset import Dataset
from handpipe.core.configuration.pose import Dixon
from handpipe.hand.checks import Check, checks
from handpipe.hand.subject import named_files
from handpipe.imaging.fat_water.echo_images import EchoImages, radians
from handpipe.imaging.fat_water.echo_signal import EchoSignal
from handpipe.imaging.fat_water.separation import Separated, separate
from handpipe.imaging.volumes.channels import pose_channels, read_channel
from handpipe.imaging.volumes.volume import Volume, pose_volume, read_volume
from handpipe.stages.images.separate_fat_water import Outputs, separate_fat_water

DATA = Path(__file__).parents[3] / "shared" / "data" / "real_mri" / "hand_dixon"
SPACING = np.array([1.0, 1.0, 3.0])
SHAPE = (72, 40, 10)
FINGERS = (14.0, 36.0, 58.0)  # middles along x, with air between
# ms and T of acquisitions: opposed, in and opposed phase; uneven phases; two echoes at two field strengths
ACQUISITIONS = {
    "three at half turns": ((3.45, 4.60, 5.75), 3.0),
    "three at thirds of a turn": ((2.3, 3.07, 3.83), 3.0),
    "four": ((1.2, 2.0, 2.8, 3.6), 3.0),
    "two at 3 T": ((1.15, 2.30), 3.0),
    "two at 1.5 T": ((2.30, 4.60), 1.5),
}


def fingers() -> tuple[np.ndarray, np.ndarray]:
    """Water and fat of three fingers: a ring of fat, muscle with a little fat, marrow in a dark shell."""
    x, y, _ = np.indices(SHAPE, dtype=float)
    water, fat = np.zeros(SHAPE), np.zeros(SHAPE)
    for middle in FINGERS:
        r = np.hypot(x - middle, y - 20)
        fat[r < 9] = 90.0
        water[r < 9] = 5.0
        water[r < 7], fat[r < 7] = 120.0, 10.0
        water[r < 4.5], fat[r < 4.5] = 0.0, 0.0
        water[r < 3], fat[r < 3] = 8.0, 80.0
    return ndimage.gaussian_filter(water, 0.5), ndimage.gaussian_filter(fat, 0.5)  # partial volume


def off_field(tesla: float) -> np.ndarray:
    """Hz: a slope over the fingers of more than the shift between fat and water, and a bow along them."""
    x, y, z = np.indices(SHAPE, dtype=float)
    return tesla / 3 * (7.0 * (x - 36) + 3.0 * (y - 20) + 1.5 * (z - 5) ** 2)


def images(
    water: np.ndarray, fat: np.ndarray, field: np.ndarray, times: tuple[float, ...], tesla: float
) -> EchoImages:
    """Echoes by the peaks of fat, one by one, with noise of a thirtieth of water and the phase of a coil."""
    ppm = (-3.80, -3.40, -2.60, -1.94, -0.39, 0.60)
    share = (0.087, 0.693, 0.128, 0.004, 0.039, 0.048)
    rng = np.random.default_rng(3)
    coil = 0.05 * np.indices(SHAPE)[0] + 1.0
    signals = []
    for time in np.array(times) * 1e-3:
        spectrum = sum(
            s * np.exp(2j * np.pi * 42.577 * tesla * p * time) for p, s in zip(ppm, share, strict=True)
        )
        signal = (water + fat * spectrum) * np.exp(1j * (coil + 2 * np.pi * field * time))
        noise = rng.normal(size=(2, *SHAPE))
        signals.append(signal + 4.0 * (noise[0] + 1j * noise[1]))
    grid = Volume(np.zeros(SHAPE, np.float32), np.diag([*SPACING, 1.0]))
    return EchoImages(np.stack(signals, axis=-1), grid, EchoSignal(np.array(times) * 1e-3, tesla))


@pytest.mark.parametrize("name", ACQUISITIONS)
def test_known_fat_water_and_field_are_found(name: str) -> None:
    times, tesla = ACQUISITIONS[name]
    water, fat = fingers()
    field = off_field(tesla)
    found = separate(images(water, fat, field, times, tesla))
    bright = water + fat > 50
    assert not found.doubtful
    assert ((found.fat > found.water) == (fat > water))[bright].mean() > 0.995
    inner = ndimage.binary_erosion(bright)
    assert np.abs(found.field - field)[inner].mean() < 4.0  # Hz, of 434 between fat and water at 3 T
    assert np.abs(found.water - water)[bright].mean() < 5.0  # noise has a deviation of 4
    assert np.abs(found.fat - fat)[bright].mean() < 5.0


def test_motion_between_echoes_is_removed() -> None:
    times, tesla = ACQUISITIONS["three at half turns"]
    water, fat = fingers()
    sharp = images(water, fat, off_field(tesla), times, tesla)
    signals = sharp.signals.copy()
    for echo in (1, 2):  # moved by 1.5 voxels along y
        moved = [
            ndimage.shift(part, (0, 1.5, 0), order=1)
            for part in (signals[..., echo].real, signals[..., echo].imag)
        ]
        signals[..., echo] = moved[0] + 1j * moved[1]
    found = separate(EchoImages(signals, sharp.grid, sharp.echoes))
    assert found.motion == pytest.approx(1.5, abs=0.3)
    bright = ndimage.binary_erosion(water + fat > 50)
    assert ((found.fat > found.water) == (fat > water))[bright].mean() > 0.97


def test_an_image_of_fat_and_water_that_are_exchanged_is_doubted() -> None:
    """A field off by half of the shift leaves two maps with fields of the same size."""
    times, tesla = ACQUISITIONS["three at half turns"]
    water, fat = fingers()
    half = 0.5 * 42.577 * tesla * 3.4
    assert separate(images(water, fat, np.full(SHAPE, half), times, tesla)).doubtful


def test_a_finger_whose_field_differs_by_half_the_shift_is_named(caplog: pytest.LogCaptureFixture) -> None:
    times, tesla = ACQUISITIONS["three at half turns"]
    water, fat = fingers()
    field = off_field(tesla)
    separate(images(water, fat, field, times, tesla))
    assert "may be exchanged" not in caplog.text
    field[47:] += 0.4 * 42.577 * tesla * 3.4
    separate(images(water, fat, field, times, tesla))
    [named] = [record.getMessage() for record in caplog.records if "may be exchanged" in record.getMessage()]
    assert "around voxel (58, 20, " in named


@pytest.mark.parametrize(
    ("low", "high", "turn"), [(-np.pi, np.pi, 2 * np.pi), (0, 4095, 4096), (-4096, 4094, 8192), (0, 360, 360)]
)
def test_units_of_phase(low: float, high: float, turn: float) -> None:
    phase = np.linspace(low, high, 500)
    np.testing.assert_allclose(np.diff(radians(Path("phase.nii"), phase)), 2 * np.pi / turn * np.diff(phase))


def test_a_phase_in_no_known_unit_is_refused() -> None:
    with pytest.raises(InputError, match=r"phase\.nii: phase: values from 0 to 700 are no whole turn"):
        radians(Path("phase.nii"), np.linspace(0, 700, 50))


def test_echoes_at_which_fat_is_as_water_are_refused() -> None:
    assert not EchoSignal(np.array([2.303e-3, 4.606e-3]), 3.0).distinct
    assert EchoSignal(np.array([3.45e-3, 4.60e-3, 5.75e-3]), 3.0).distinct


@pytest.mark.parametrize(
    ("echoes", "said"),
    [
        ([(3.4, "p"), (4.6, None)], "without phase nobody can tell fat from water"),
        ([(4.6, "p"), (3.4, "q")], "has to increase"),
        ([(4.6, "p")], "at least 2 items"),
    ],
)
def test_echoes_that_do_not_suffice_are_refused(echoes: list[tuple[float, str | None]], said: str) -> None:
    content = [{"time_ms": t, "magnitude": "m", "phase": p} for t, p in echoes]
    with pytest.raises(ValueError, match=said):
        Dixon.model_validate({"echoes": content, "field_T": 3})


def subject(folder: Path, name: str) -> Dataset:
    """A subject whose pose has echoes and a channel, in files with an axis that is stored backwards."""
    times, tesla = ACQUISITIONS[name]
    water, fat = fingers()
    signals = images(water, fat, off_field(tesla), times, tesla).signals
    for echo in range(len(times)):
        for kind, values in (
            ("magnitude", np.abs(signals[..., echo])),
            ("phase", np.angle(signals[..., echo])),
        ):
            image = nibabel.Nifti1Image(values[:, ::-1].astype(np.float32), turned())
            nibabel.save(image, folder / f"{kind}{echo}.nii.gz")
    pose = {
        "role": "neutral",
        "volume": "magnitude0.nii.gz",
        "seeds": "seeds.nii.gz",
        "channels": {"later": "magnitude1.nii.gz"},
        "dixon": {
            "echoes": [
                {"time_ms": t, "magnitude": f"magnitude{i}.nii.gz", "phase": f"phase{i}.nii.gz"}
                for i, t in enumerate(times)
            ],
            "field_T": tesla,
        },
    }
    content = {"name": "mine", "root": folder, "poses": {"neutral": pose}}
    return Dataset.model_validate({**content, "bones": {"phalanx": {"label": 1}}, "joints": {}})


def turned() -> np.ndarray:
    """The affine of a file whose second axis is stored backwards."""
    affine = np.diag([*SPACING, 1.0])
    affine[1, 1], affine[1, 3] = -1.0, SHAPE[1] - 1.0
    return affine


def test_the_stage_writes_images_on_the_grid_of_the_volume(tmp_path: Path) -> None:
    dataset = subject(tmp_path, "two at 3 T")
    outputs = Outputs(*(tmp_path / f"out/{n}" for n in ("w.nii.gz", "f.nii.gz", "d.nii.gz", "m.json")))
    separate_fat_water(outputs, dataset, "neutral")
    water, fat = fingers()
    volume = pose_volume(dataset, "neutral")
    found = read_channel(outputs.fat, volume).values > read_channel(outputs.water, volume).values
    assert (found == (fat > water))[water + fat > 50].mean() > 0.99
    assert metrics.read(outputs.metrics)["may_be_exchanged"] == (0.0, "1")


def test_channels_and_echoes_are_checked(tmp_path: Path) -> None:
    dataset = subject(tmp_path, "two at 3 T")
    files = {"poses.neutral.channels.later", "poses.neutral.dixon.echoes.1.phase"}
    assert files < named_files(dataset).keys()
    (later,) = pose_channels(dataset, "neutral", pose_volume(dataset, "neutral")).values()
    direct = np.asarray(nibabel.load(tmp_path / "magnitude1.nii.gz").dataobj)[:, ::-1]
    np.testing.assert_array_equal(later.values, direct)

    def said() -> list[str]:
        return [str(fault) for check in checks(dataset) if (fault := failure(check)) is not None]

    assert [text for text in said() if "seeds" not in text] == []
    image = nibabel.load(tmp_path / "magnitude1.nii.gz")
    values = np.asarray(image.dataobj)
    nibabel.save(nibabel.Nifti1Image(values[1:], image.affine), tmp_path / "magnitude1.nii.gz")
    assert any(
        "grid: is not the volume's" in t and "Resample it to the grid of the pose" in t for t in said()
    )
    values[3, 3, 3] = np.nan
    nibabel.save(nibabel.Nifti1Image(values, image.affine), tmp_path / "magnitude1.nii.gz")
    assert any("magnitude1.nii.gz: values: 1 voxels are NaN" in text for text in said())


def failure(check: Check) -> Exception | None:
    try:
        check.run()
    except HandpipeError as error:
        return error
    return None


@pytest.fixture(scope="module")
def hand() -> tuple[Separated, np.ndarray, np.ndarray]:
    """A real hand separated, and the images that came with it, which are wrong in both end slices."""
    files = sorted(DATA.glob("00*.nii.gz"))
    if not files:
        pytest.skip("the shared real MRI is not beside the checkout")
    magnitudes, phases = ([read_volume(f) for f in files[i::2]] for i in (0, 1))
    signals = np.stack(
        [
            m.values * np.exp(1j * radians(files[0], p.values))
            for m, p in zip(magnitudes, phases, strict=True)
        ],
        axis=-1,
    )
    echoes = EchoSignal(np.array([3.45, 4.60, 5.75]) * 1e-3, 3.0)
    water, fat = (read_volume(DATA / f"{name}.nii.gz").values for name in ("water", "fat"))
    return separate(EchoImages(signals, magnitudes[0], echoes)), water, fat


def test_a_real_hand_is_separated_as_its_own_images_are(
    hand: tuple[Separated, np.ndarray, np.ndarray],
) -> None:
    found, water, fat = hand
    middle = found.tissue.copy()
    middle[..., [0, -1]] = False
    fatty = 0.62 * found.fat > found.water  # fat's peaks cancel one another to 0.62 of the whole
    assert (fatty == (fat > water))[middle].mean() > 0.93
    sure = middle & (np.abs(water - fat) > 0.5 * (np.abs(water) + np.abs(fat)))
    assert (fatty == (fat > water))[sure].mean() > 0.975
    assert np.corrcoef(found.water[middle], water[middle])[0, 1] > 0.92
    assert np.corrcoef(found.fat[middle], fat[middle])[0, 1] > 0.88
    assert not found.doubtful
    assert 0.8 < found.motion < 4  # mm, at the corners of the image's middle half


def test_no_finger_of_a_real_hand_is_exchanged(hand: tuple[Separated, np.ndarray, np.ndarray]) -> None:
    """Each part that air separates in a slice, and each 12 mm square of the hand, agrees by itself."""
    found, water, fat = hand
    agree = (0.62 * found.fat > found.water) == (fat > water)
    for plane in range(1, 8):
        inside = found.tissue[..., plane]
        parts, count = ndimage.label(ndimage.binary_fill_holes(inside))
        squares = np.add.outer(np.arange(320) // 21 * 100, np.arange(160) // 21) + 1
        for groups in (parts, squares):
            for group in np.unique(groups[inside]):
                chosen = inside & (groups == group)
                if chosen.sum() > 150:
                    assert agree[..., plane][chosen].mean() > 0.6, (plane, count, group)
