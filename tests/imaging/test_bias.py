from phalanx import Phalanx, grid_points

from handpipe.imaging.bias import correct_bias


def test_correction_flattens_marrow_and_fat() -> None:
    phalanx = Phalanx()
    volume = phalanx.volume()
    points = grid_points(volume)
    field = 1 + 0.25 * points[..., 0] / 16 + 0.1 * (points[..., 1] / 9) ** 2
    corrected = correct_bias(volume.like(volume.values * field))
    marrow = phalanx.marrow(points) < -0.8
    before, after = (volume.values * field)[marrow], corrected.values[marrow]
    assert after.std() / after.mean() < 0.6 * before.std() / before.mean()
