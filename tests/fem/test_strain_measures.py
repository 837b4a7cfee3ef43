"""Green strain and Cauchy stress of tets against formulas that do not go by the first Piola stress."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from handpipe.fem.contact.constraints import Contact
from handpipe.fem.contact.pressure import contact_pressures
from handpipe.fem.elements import plasticity
from handpipe.fem.elements.materials import Material
from handpipe.fem.elements.strain_measures import green_strains, von_mises
from handpipe.fem.potentials.elastic import Elastic, shape_gradients
from handpipe.mesh.surfaces.surface import Surface

from .bodies import box

YOUNG, POISSON = 8.0, 0.45  # kPa, 1
MU, LAM = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
STRAINS = np.array([1.2, 0.1, -0.05, 0.9, 0.03, 1.1])
TURN = Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()


def block(**options) -> Elastic:
    vertices, tets = box((4.0, 2.0, 2.0), (3, 2, 2))
    return Elastic(vertices, tets, Material(YOUNG, POISSON), **options)


def density(stretch: float, across: float) -> float:
    """Smith et al. 2018's energy of diag(stretch, across, across), as written there."""
    m, bulk = 4 / 3 * MU, LAM + 5 / 6 * MU
    squares, volume = stretch**2 + 2 * across**2, stretch * across**2
    alpha = 1 + m / bulk - m / (4 * bulk)
    return m / 2 * (squares - 3) + bulk / 2 * (volume - alpha) ** 2 - m / 2 * np.log(squares + 1)


def uniaxial(stretch: float) -> tuple[float, float]:
    """The free stretch across, and the stress along: the energy's derivatives by differences."""
    h = 1e-6

    def across(b: float) -> float:
        return (density(stretch, b + h) - density(stretch, b - h)) / (2 * h)

    free = brentq(across, 0.5, 2.0, xtol=1e-13)
    along = (density(stretch + h, free) - density(stretch - h, free)) / (2 * h)
    return free, along / free**2


def test_green_strains_of_simple_shear_and_of_a_rotation():
    k = 0.3
    shear = np.array([[1, k, 0], [0, 1, 0], [0, 0, 1.0]])
    expected = np.array([[0, k / 2, 0], [k / 2, k**2 / 2, 0], [0, 0, 0]])
    found = green_strains(np.stack([shear, TURN @ shear, TURN]))
    np.testing.assert_allclose(found, [expected, expected, np.zeros((3, 3))], atol=1e-14)


@pytest.mark.parametrize("stretch", [0.7, 1.0, 1.25, 1.6])
def test_uniaxial_stress_is_the_derivative_of_the_energy(stretch: float):
    free, expected = uniaxial(stretch)
    body = block()
    x = body.vertices * [stretch, free, free] @ TURN.T
    stress = body.cauchy_stresses(x)
    turned = TURN @ np.diag([expected, 0, 0]) @ TURN.T
    np.testing.assert_allclose(stress, np.broadcast_to(turned, stress.shape), atol=1e-6)
    np.testing.assert_allclose(von_mises(stress), abs(expected), atol=1e-6)
    assert stretch == 1.0 or abs(expected) > 0.5  # kPa


def test_plastic_strain_alone_is_free_of_stress():
    body = block(strains=np.tile(STRAINS, (len(block().tets), 1)))
    x = body.vertices @ plasticity.to_matrices(STRAINS[None])[0].T @ TURN.T
    np.testing.assert_allclose(body.cauchy_stresses(x), 0, atol=1e-12)
    assert np.abs(body.cauchy_stresses(body.vertices)).max() > 0.1


def test_pressure_of_a_small_change_of_volume_is_the_bulk_modulus():
    body, change = block(), 1e-5
    stress = body.cauchy_stresses(body.vertices * (1 + change))
    expected = 3 * change * (LAM + 2 / 3 * MU) * np.eye(3)
    np.testing.assert_allclose(stress, np.broadcast_to(expected, stress.shape), rtol=1e-3, atol=1e-9)


def test_stresses_are_symmetric_and_balance_the_gradient():
    """Nodal forces are sums over tets of stress times the gradients of the deformed shape functions."""
    rng = np.random.default_rng(2)
    count = len(block().tets)
    strains = plasticity.exp(0.1 * rng.normal(size=(count, 6)))
    body = block(strains=strains, weights=rng.uniform(0.1, 1.0, count))
    x = body.vertices + 0.05 * rng.normal(size=body.vertices.shape)
    stress = body.cauchy_stresses(x)
    np.testing.assert_allclose(stress, stress.transpose(0, 2, 1), atol=1e-12)
    gradients, volumes = shape_gradients(x, body.tets)
    forces = np.zeros_like(x)
    np.add.at(forces, body.tets, np.einsum("mij,mcj,m->mci", stress, gradients, volumes))
    np.testing.assert_allclose(forces, body.gradient(x), atol=1e-11)


def test_pressure_on_a_flat_plate_is_that_of_its_springs():
    """Each vertex has k A of stiffness: the penalty's force over its area is k (d - onset / 2)."""
    side, depth, onset, stiffness = np.linspace(0, 3, 4), 0.2, 0.05, 50.0
    grid = np.stack(np.meshgrid(side, side, [-depth], indexing="ij"), axis=-1).reshape(-1, 3)
    cells = np.array(
        [[4 * i + j, 4 * i + j + 1, 4 * i + j + 4, 4 * i + j + 5] for i in range(3) for j in range(3)]
    )
    plate = Surface(grid, np.concatenate([cells[:, [0, 1, 2]], cells[:, [1, 3, 2]]]))
    assert np.allclose(plate.vertex_normals(), [0, 0, -1])
    areas = np.zeros(len(grid))
    np.add.at(areas, plate.triangles, 0.5 / 3)
    up = np.tile([0, 0, 1.0], (len(grid), 1))
    floor = Contact(np.eye(len(grid)), np.zeros_like(grid), up, stiffness * areas, onset)
    expected = stiffness * (depth - onset / 2)
    np.testing.assert_allclose(contact_pressures([floor], plate), expected)
    np.testing.assert_allclose(contact_pressures([floor], plate.moved(grid + [0, 0, 1])), 0)
