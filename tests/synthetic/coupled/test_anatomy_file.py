"""What is written of a coupled body's anatomy and read again."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from benchmarks.truth import toy

from handpipe.core.errors import InputError
from handpipe.synthetic.coupled import anatomy_file


def test_an_anatomy_comes_back_as_it_went(tmp_path):
    anatomy = toy.finger(5.0)
    slack = replace(next(iter(anatomy.strands.values())), stiffness=0.0, tension=50.0, bones={})
    anatomy = replace(anatomy, strands={**anatomy.strands, "slack": slack})
    anatomy_file.save(tmp_path / "body.h5", anatomy)
    found = anatomy_file.load(tmp_path / "body.h5")
    np.testing.assert_array_equal(found.mesh.vertices, anatomy.mesh.vertices)
    np.testing.assert_array_equal(found.mesh.tets, anatomy.mesh.tets)
    np.testing.assert_array_equal(found.labels, anatomy.labels)
    assert found.regions == anatomy.regions
    for here, there in ((found.bones, anatomy.bones), (found.fibres, anatomy.fibres)):
        assert list(here) == list(there)
        for name, values in here.items():
            np.testing.assert_array_equal(values, there[name])
    assert list(found.strands) == list(anatomy.strands)
    for name, strand in found.strands.items():
        here, there = asdict(strand), asdict(anatomy.strands[name])
        np.testing.assert_array_equal(here.pop("points"), there.pop("points"))
        assert here == there


def test_a_damaged_file_is_said_to_be_one(tmp_path):
    path = tmp_path / "body.h5"
    anatomy_file.save(path, toy.finger(5.0))
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(InputError, match="body.h5"):
        anatomy_file.load(path)
