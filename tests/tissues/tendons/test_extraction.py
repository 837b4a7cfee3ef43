import numpy as np
from tests.imaging.phalanx import Phalanx, grid_points

from handpipe.imaging.bone_surfaces.marrow import contour
from handpipe.imaging.evidence.tubes import tangents_of
from handpipe.mesh.surfaces.distance import Distance
from handpipe.tissues.tendons.fitting.extraction import centre_finder


def test_a_curve_within_a_bone_finds_the_tendon_beside_it() -> None:
    phalanx = Phalanx()
    volume = phalanx.volume()
    bone = contour(volume.like(-phalanx.bone(grid_points(volume))), 0.0)
    z = -(phalanx.marrow_radius + 1.1 + phalanx.tendon_radius - 0.1)
    curve = np.stack(
        [np.linspace(-6, 6, 20), np.full(20, 0.3), np.full(20, 0.4 - phalanx.marrow_radius)], axis=1
    )
    assert Distance(bone).signed(curve)[0].max() < -0.5
    find = centre_finder(volume, phalanx.tendon_radius, Distance(bone))
    for _ in range(3):
        curve, confidence = find(curve, tangents_of(curve))
    assert confidence.min() > 0.2
    assert np.hypot(curve[:, 1], curve[:, 2] - z).max() < 0.15
