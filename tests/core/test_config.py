"""Dataset and scene files: what is wrong in them is named with file and field."""

from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from handpipe.core.configuration.dataset import load_dataset
from handpipe.core.configuration.scene import Scene, load_scene
from handpipe.core.configuration.settings import EDGES, Edges, require_fidelity, settings_of
from handpipe.core.errors import InputError
from handpipe.core.layer_registry import LAYERS

CONFIG = Path(__file__).parents[2] / "config"


@pytest.fixture
def content():
    return yaml.safe_load((CONFIG / "datasets/phantom-finger.yaml").read_text(encoding="utf-8"))


def written(tmp_path, content):
    path = tmp_path / "subject.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("path", sorted((CONFIG / "datasets").glob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_datasets_are_valid(path):
    data = load_dataset(path)
    assert data.neutral and data.examples and data.root_bone in data.bones


@pytest.mark.parametrize("path", sorted((CONFIG / "scenes").glob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_scenes_are_valid(path):
    assert "bones" in load_scene(path).needed


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda c: c["poses"]["hook"].pop("volume"), r"poses\.hook\.volume"),
        (lambda c: c["poses"]["neutral"].pop("seeds"), r"poses\.neutral.*neutral pose needs seeds"),
        (lambda c: c.update(images={"model": "physics", "field": 2}), r"images\.field.*1\.5 and at 3 T"),
        (lambda c: c.update(images={"effects": {"fog": "usual"}}), r"images\.effects.*fog"),
        (lambda c: (c.pop("generator"), c.update(images={})), "images: is only for generated"),
        (lambda c: c["poses"]["hook"].update(role="neutral"), "exactly one pose has the role neutral"),
        (lambda c: c["joints"]["PIP2"].update(parent="femur"), r"joints\.PIP2.*'femur'"),
        (lambda c: c["tendons"]["flexor2"].update(bones=["femur"]), r"tendons\.flexor2.*'femur'"),
        (
            lambda c: c["tendons"]["flexor2"].update(bone="distal2"),
            r"tendons\.flexor2.*bone: is no field.*remove",
        ),
        (lambda c: c["joints"]["PIP2"].update(limits_deg=[]), r"joints\.PIP2.*same length"),
        (lambda c: c.update(units="m"), "units"),
        (lambda c: c["tendons"]["flexor2"].update(radius=float("nan")), r"tendons\.flexor2\.radius.*finite"),
        (lambda c: c["tendons"]["flexor2"].update(radius=-1), r"tendons\.flexor2\.radius"),
        (lambda c: c["joints"]["PIP2"].update(limits_deg=[[float("inf"), 1]]), r"joints\.PIP2.*finite"),
        (lambda c: c["joints"]["PIP2"].update(limits_deg=[[9, 1]]), r"joints\.PIP2.*no range"),
        (lambda c: c["joints"]["PIP2"].update(axis_hints=[[0, 0, 0]]), r"joints\.PIP2.*zero length"),
        (lambda c: c["joints"]["PIP2"].update(angles=["DIP2_flexion"]), "angle 'DIP2_flexion' stands twice"),
        (lambda c: c["bones"]["middle2"].update(label=1), "bones: the label 1 stands twice"),
        (
            lambda c: c["muscles"].update({"Müller 1": c["muscles"]["lumbrical1"]}),
            r"muscles\.Müller 1: .*no name",
        ),
        (lambda c: c.update(colour="blue"), "colour"),
        (
            lambda c: c["joints"]["MP2"].update(parent="distal2"),
            "joints: DIP2, MP2, PIP2 carry one another in a circle",
        ),
    ],
)
def test_wrong_dataset_is_refused_by_field(tmp_path, content, change, field):
    change(content)
    with pytest.raises(InputError, match=r"subject\.yaml: .*" + field):
        load_dataset(written(tmp_path, content))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda c: c.update(root="/etc/subject"), "root: is /etc/subject, but .* under results/subject"),
        (lambda c: c.update(root="results/subject/../other"), "root: is results/subject/../other"),
        (lambda c: c.update(root="results/phantom-finger/data"), "root: .* stays under results/subject"),
        (
            lambda c: c["poses"]["hook"].update(volume="../../../x.nii.gz"),
            r"poses\.hook\.volume: .* leads out",
        ),
        (lambda c: c["poses"]["hook"].update(scan="/x.ply"), r"poses\.hook\.scan: .* leads out"),
        (
            lambda c: c["tendons"]["flexor2"].update(path="../../x.json"),
            r"tendons\.flexor2\.path: .* leads out",
        ),
        (lambda c: c.update(truth={"folder": ".."}), r"truth\.folder: is \.\., which leads out"),
    ],
)
def test_what_is_generated_stays_in_its_folder_of_results(tmp_path, monkeypatch, content, change, field):
    monkeypatch.chdir(tmp_path)
    content["root"] = "results/subject/data"
    assert load_dataset(written(tmp_path, content)).generator
    change(content)
    with pytest.raises(InputError, match=r"subject\.yaml: " + field):
        load_dataset(written(tmp_path, content))


def test_a_link_out_of_the_results_is_refused(tmp_path, monkeypatch, content):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "results/subject").mkdir(parents=True)
    (tmp_path / "results/subject/data").symlink_to(tmp_path / "elsewhere")
    content["root"] = "results/subject/data"
    with pytest.raises(InputError, match="root: is results/subject/data"):
        load_dataset(written(tmp_path, content))


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("truth", r"truth\.folder: is truth, which leads out"),
        ("seeds", r"poses\.\w+\.seeds: is seeds/"),
        ("flexor2.json", r"tendons\.flexor2\.path: is flexor2\.json"),
    ],
)
def test_a_link_out_of_the_own_folder_is_refused(tmp_path, monkeypatch, content, name, field):
    """A folder of files, a folder that is itself given, and a file."""
    monkeypatch.chdir(tmp_path)
    content["root"] = "results/subject/data"
    content["truth"] = {"folder": "."}
    assert load_dataset(written(tmp_path, content)).generator
    content["truth"] = {"folder": "truth"}
    content["poses"]["hook"]["seeds"] = "seeds/hook.nii.gz"
    content["tendons"]["flexor2"]["path"] = "flexor2.json"
    (tmp_path / "results/subject/data").mkdir(parents=True)
    assert load_dataset(written(tmp_path, content)).generator
    (tmp_path / "results/subject/data" / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=field):
        load_dataset(written(tmp_path, content))


def test_a_key_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("layers: [bones]\nframes: a.csv\nframes: b.csv\n")
    with pytest.raises(InputError, match=r"scene\.yaml: YAML: .*'frames' stands twice.*line 3"):
        load_scene(path)


def test_unknown_layer_is_refused(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("layers: [bones, cartilage]\nframes: x.csv\n")
    with pytest.raises(InputError, match=r"scene\.yaml: .*'cartilage' is not a layer"):
        load_scene(path)


def test_an_aid_is_no_layer_to_ask_for():
    with pytest.raises(
        ValueError, match="'flesh' is not a layer; the layers are bones, bone_fascia, tendons"
    ):
        Scene(layers=("flesh",), frames="x.csv")


def test_scene_needs_exactly_what_its_layers_stand_on():
    with pytest.raises(ValueError, match="muscle_barrier: needs muscles"):
        Scene(layers=("bones", "skin"), frames="x.csv", muscle_barrier=True)
    assert Scene(layers=("muscles",), frames="x.csv", muscle_barrier=True).muscle_barrier
    with pytest.raises(ValueError, match="viscosity: counts from frame to frame"):
        Scene(layers=("fat",), frames="x.csv", viscosity=0.04)
    with pytest.raises(ValueError, match="equilibria: a viscous tissue is at none"):
        Scene(layers=("fat",), frames="x.csv", viscosity=0.04, follow=True, equilibria=True)
    with pytest.raises(ValueError, match="viscosity: needs muscles, ligaments, fat or skin"):
        Scene(layers=("tendons",), frames="x.csv", viscosity=0.04, follow=True)
    assert Scene(layers=("muscles",), frames="x.csv", viscosity=0.04, follow=True).viscosity
    assert Scene(layers=("bones", "skin"), frames="x.csv").needed == ["bones", "skin"]
    assert Scene(layers=("muscles",), frames="x.csv").needed == ["bones", "flesh", "muscles"]
    assert Scene(layers=("fat", "skin"), frames="x.csv").needed == list(LAYERS)


def test_a_dataset_like_another_has_its_keys_where_it_has_none():
    whole, preview = (
        load_dataset(CONFIG / f"datasets/phantom-hand-{n}.yaml") for n in ("complete", "preview")
    )
    assert preview.bones == whole.bones
    assert preview.name == "phantom-hand-preview"
    assert "fist" in whole.poses and "fist" not in preview.poses


@pytest.mark.parametrize("like", ["nowhere", "phantom-hand-preview"])
def test_a_dataset_is_like_one_that_is_whole_itself(tmp_path, like):
    for file in (CONFIG / "datasets").glob("phantom-hand-*.yaml"):
        (tmp_path / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    path = tmp_path / "mine.yaml"
    path.write_text(f"name: mine\nroot: .\nlike: {like}\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"mine\.yaml: like"):
        load_dataset(path)


GIVEN = {
    "subjects": "one-hand",
    "scenes": ["pinch", "fist"],
    "fidelity": "preview",
    "interpolation": "rbf",
    "truth": "toy",
}
BEFORE = {
    "muscle": 2.5,
    "bone_fascia": 2.5,
    "muscle_fascia": 2.5,
    "tendon": 1.2,
    "skin": 2.5,
    "crease": 1.2,
    "fat": 4.0,
    "flesh": 4.0,
}


def test_settings_have_one_form_however_they_are_given():
    found = settings_of(GIVEN | {"edges": {"muscle": "1.8", "fascia": 2, "skin": "25e-1"}})
    assert found.subjects == ("one-hand",)
    assert found.scenes == ("pinch", "fist")
    assert found.sizes == Edges(**BEFORE | {"muscle": 1.8, "bone_fascia": 2.0, "muscle_fascia": 2.0})
    assert {type(value) for _, value in found.sizes} == {float}


def test_preview_has_the_lengths_that_were_the_default():
    """Builds from before fidelities keep their meshes."""
    assert settings_of(GIVEN).sizes.model_dump() == BEFORE


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"fascia": 1.0}, (1.0, 1.0)),
        ({"fascia": 1.0, "bone_fascia": 0.7}, (0.7, 1.0)),
        ({"fascia": 1.0, "muscle_fascia": 0.7}, (1.0, 0.7)),
        ({"muscle_fascia": 0.7}, (2.5, 0.7)),
    ],
)
def test_single_edges_replace_those_of_the_fidelity(given, expected):
    found = settings_of(GIVEN | {"edges": given})
    assert (found.sizes.bone_fascia, found.sizes.muscle_fascia) == expected
    assert found.sizes.fat == EDGES["preview"].fat


def test_each_fidelity_is_at_least_as_fine_as_the_one_before():
    lengths = [list(EDGES[name].model_dump().values()) for name in ("preview", "standard", "paper")]
    assert all(b <= a for one, next_ in pairwise(lengths) for a, b in zip(one, next_, strict=True))
    assert lengths[0] != lengths[1] != lengths[2]


def test_a_scene_of_another_fidelity_is_refused():
    scene = Scene(layers=("bones",), frames="frames.csv", fidelity="paper")
    require_fidelity("fist.yaml", scene, settings_of(GIVEN | {"fidelity": "paper"}))
    with pytest.raises(InputError, match="--config fidelity=paper") as caught:
        require_fidelity("fist.yaml", scene, settings_of(GIVEN))
    assert (caught.value.source, caught.value.field) == ("fist.yaml", "fidelity")


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"edges": {"muscle": "wide"}}, "edges.muscle"),
        ({"edges": {"fat": 0}}, "edges.fat"),
        ({"edges": {"skin": "nan"}}, "edges.skin"),
        ({"edges": {"bones": 1}}, "edges.bones"),
        ({"fidelity": "papers"}, "fidelity"),
        ({"interpolation": "linear"}, "interpolation"),
        ({"subjects": ["One Hand"]}, "subjects.0"),
        ({"subject": "one-hand"}, "subject"),
    ],
)
def test_wrong_settings_are_named(change, field):
    with pytest.raises(InputError) as caught:
        settings_of({**GIVEN, **change}, "config.yaml")
    assert (caught.value.source, caught.value.field) == ("config.yaml", field)
