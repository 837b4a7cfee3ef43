"""From a file of curves to a mesh for simulation: a toy forearm, and the cases that are hard."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy import sparse
from tests.anatomy.arm import THREE_MUSCLES, arm
from tests.anatomy.meshes import require_closed_labels, require_conforming

from handpipe.anatomy.templates.curves import CurveFile
from handpipe.anatomy.templates.diffusion import Factorise, superlu
from handpipe.anatomy.templates.domain import Domain
from handpipe.anatomy.templates.tissue_mesh import TissueMesh, build_tissue_mesh
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

Limb = tuple[Domain, Surface, dict[str, Surface]]


@pytest.fixture(scope="module")
def limb() -> Limb:
    skin, bones = arm(5.0)
    return Domain.between(skin, bones, 5.0), skin, bones


def built(limb: Limb, content: dict, factorise: Factorise = superlu) -> TissueMesh:
    file = CurveFile.model_validate(content)
    return build_tissue_mesh(file, limb[0], limb[2], factorise=factorise, source="arm.yaml")


def three() -> dict:
    return dict(yaml.safe_load(THREE_MUSCLES))


@pytest.fixture(scope="module")
def template(limb: Limb) -> TissueMesh:
    return built(limb, three())


def require_fit(template: TissueMesh, limb: Limb) -> None:
    """Manifold, without overlaps or gaps, of good tets."""
    _, skin, bones = limb
    room = skin.volume() - bones["radius"].volume()
    np.testing.assert_allclose(template.mesh.volumes().sum(), room, rtol=1e-3)
    require_conforming(template.mesh, template.mesh.boundary().area())
    require_closed_labels(template.mesh, template.labels)
    metrics = template.metrics()
    assert metrics["manifold"][0] == 1
    assert metrics["smallest_dihedral"][0] >= 5


def test_three_muscles(template: TissueMesh, limb: Limb) -> None:
    domain, skin, bones = limb
    require_fit(template, limb)
    assert template.names == ("fat", "flexor", "extensor", "abductor") and template.warnings == ()
    assert np.array_equal(template.mesh.vertices[template.skin], skin.vertices)
    assert np.array_equal(template.mesh.vertices[template.bones["radius"]], bones["radius"].vertices)
    for name, side in (("flexor", [0, 0, -1]), ("extensor", [0, 0.8, 0.6]), ("abductor", [0, -0.8, 0.6])):
        middle = template.surface(name).centroid()
        assert middle @ side > 8 and np.linalg.norm(np.cross(middle * [0, 1, 1], side)) < 2
        assert len(template.surface(name).components()) == 1


def test_fibres_run_along_muscles_and_fat_has_none(template: TissueMesh) -> None:
    length = np.linalg.norm(template.fibres, axis=1)
    np.testing.assert_allclose(length, np.where(template.labels > 0, 1.0, 0.0), atol=1e-9)
    for label, name in enumerate(template.names[1:], start=1):
        along = template.fibres[template.labels == label, 0]
        assert np.average(along) > 0.75
        assert len(template.origins[name]) and len(template.insertions[name])
        ends = [template.mesh.vertices[v[name], 0].mean() for v in (template.origins, template.insertions)]
        assert ends[1] - ends[0] > 30


def test_artifact_keeps_everything(template: TissueMesh, tmp_path: Path) -> None:
    template.save(tmp_path / "template.h5")
    again = TissueMesh.load(tmp_path / "template.h5")
    assert np.array_equal(again.mesh.tets, template.mesh.tets) and again.names == template.names
    assert np.array_equal(again.fibres, template.fibres)
    assert np.array_equal(again.origins["flexor"], template.origins["flexor"])


def test_volumes_that_are_asked_for(limb: Limb) -> None:
    content = three()
    content["muscles"]["flexor"]["volume"] = 9000.0
    content["muscles"]["abductor"]["volume"] = 9000.0
    template = built(limb, content)
    require_fit(template, limb)
    np.testing.assert_allclose(template.volumes()[[1, 3]], 9000, rtol=0.0101)


class Elsewhere:
    """A factor on a machine that rounds otherwise: the last digits of its solutions are others."""

    def __init__(self, matrix: sparse.csr_matrix) -> None:
        self.factor = superlu(matrix)

    def solve(self, b: np.ndarray) -> np.ndarray:
        x = self.factor.solve(b)
        return x * (1 + 1e-14 * np.random.default_rng(1).standard_normal(x.shape))


def test_another_machines_rounding_makes_the_same_mesh(limb: Limb) -> None:
    content = three()
    content["muscles"]["flexor"]["volume"] = 9000.0
    here, there = (built(limb, content, factorise) for factorise in (superlu, Elsewhere))
    assert np.array_equal(here.mesh.tets, there.mesh.tets)
    assert np.array_equal(here.mesh.vertices, there.mesh.vertices)


def test_muscle_of_three_heads_and_a_broad_origin(limb: Limb) -> None:
    """Heads that run together: one part, attached along the bone between them, fibres towards the one end."""
    heads = [(0.2, [-3, 0, -10]), (0.5, [6, 0, -10]), (0.8, [15, 0, -10])]
    end = {"at": [22, 0, -14]}
    content = {
        "fat": 0.2,
        "muscles": {
            "fan": {
                "curves": [
                    {"points": [{"bone": "radius", "along": a, "towards": [0, 0, -1]}, {"at": p}, end]}
                    for a, p in heads
                ],
                "attachments": [
                    {
                        "end": "origin",
                        "reach": 2.5,
                        "points": [{"bone": "radius", "along": a, "towards": [0, 0, -1]} for a in (0.2, 0.8)],
                    }
                ],
            }
        },
    }
    template = built(limb, content)
    require_fit(template, limb)
    assert template.warnings == () and len(template.surface("fan").components()) == 1
    origin = template.mesh.vertices[template.origins["fan"]]
    assert np.ptp(origin[:, 0]) > 35 and (np.linalg.norm(origin[:, 1:], axis=1) < 5.5).mean() > 0.9
    muscle = template.labels == 1
    centre = template.mesh.vertices[template.mesh.tets[muscle]].mean(axis=1)
    far = np.linalg.norm(centre - end["at"], axis=1) > 12
    towards = np.array(end["at"]) - centre[far]
    # Tets behind an origin may point elsewhere.
    assert ((template.fibres[muscle][far] * towards).sum(axis=1) > 0).mean() > 0.9


def test_two_crossing_curves(limb: Limb) -> None:
    """What is asked for cannot be: the mesh is sound, and the warning names both muscles and the place."""
    lines = [[[-20, -8, -10], [20, 8, -10]], [[-20, 8, -10], [20, -8, -10]]]
    content = {
        "fat": 0.3,
        "muscles": {
            name: {"curves": [{"points": [{"at": p} for p in line]}], "reach": 6}
            for name, line in zip(("a", "b"), lines, strict=True)
        },
    }
    template = built(limb, content)
    require_fit(template, limb)
    assert (template.volumes() > 100).all()
    assert any("b and a" in text and "-10.0)" in text for text in template.warnings)


def test_muscle_thinner_than_a_tet(limb: Limb) -> None:
    """A muscle of about 1 mm radius in tets of 5 mm: thin, whole, and sound."""
    content = three()
    content["muscles"] = {
        "thin": {
            "curves": [{"points": [{"at": [-25, 1, -11]}, {"at": [25, -1, -12]}]}],
            "volume": 300.0,
            "edge_length": 1.2,
        }
    }
    template = built(limb, content)
    require_fit(template, limb)
    np.testing.assert_allclose(template.volumes()[1], 300, rtol=0.0101)
    surface = template.surface("thin")
    assert np.ptp(surface.vertices[:, 0]) > 25
    assert Distance(surface).closest(np.array([[0.0, 0, -11.5]]))[0][0] < 2


def test_muscle_that_is_nowhere_is_named(limb: Limb) -> None:
    content = three()
    content["muscles"]["flexor"]["curves"][0]["points"] = [
        {"at": [-10, 0, -12], "tissue": 0.001},
        {"at": [10, 0, -12], "tissue": 0.001},
    ]
    with pytest.raises(InputError, match="arm.yaml: muscles.flexor: is nowhere"):
        built(limb, content)
