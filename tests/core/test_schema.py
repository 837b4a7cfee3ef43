"""The JSON schemas are current, accept what ships, and refuse what loading refuses."""

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

from handpipe.core.configuration import schema
from handpipe.core.configuration.dataset import Dataset

ROOT = Path(__file__).parents[2]
SCHEMAS = ROOT / "workflow/schemas"
TEMPLATE = ROOT / "config/datasets/example-own-scans.yaml.template"


def validator(name):
    return jsonschema.Draft202012Validator(
        json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))
    )


def content(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", schema.MODELS)
def test_shipped_schemas_are_those_of_the_models(name, tmp_path):
    written = {p.name: p.read_text(encoding="utf-8") for p in schema.write_schemas(tmp_path)}
    stale = "Run: python -m handpipe.core.configuration.schema workflow/schemas"
    assert (SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8") == written[f"{name}.schema.json"], (
        stale
    )


@pytest.mark.parametrize("name", schema.MODELS)
def test_schemas_are_schemas(name):
    jsonschema.Draft202012Validator.check_schema(json.loads(schema.schema(name)))


@pytest.mark.parametrize(
    "path",
    [
        *sorted((ROOT / "config/datasets").glob("*.yaml")),
        *sorted((ROOT / "config/scenes").glob("*.yaml")),
        TEMPLATE,
    ],
    ids=lambda p: p.stem,
)
def test_shipped_files_follow_their_schema(path):
    name = "dataset" if path.parent.name == "datasets" else "scene"
    assert not list(validator(name).iter_errors(content(path)))


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c["poses"]["neutral"].pop("volume"),
        lambda c: c["poses"]["neutral"].update(role="unknown"),
        lambda c: c["poses"]["neutral"].update(volumes="typo.nii.gz"),
        lambda c: c["bones"]["distal2"].update(label=255),
        lambda c: c["joints"]["PIP2"].update(type="hinge"),
        lambda c: c["tendons"]["flexor2"].update(radius=0),
        lambda c: c.update(units="m"),
    ],
)
def test_what_a_schema_refuses_the_loader_refuses(change):
    wrong = content(TEMPLATE)
    change(wrong)
    assert list(validator("dataset").iter_errors(wrong))
    with pytest.raises(ValueError, match="validation error"):
        Dataset.model_validate(wrong)


def test_template_is_a_valid_dataset():
    data = Dataset.model_validate(content(TEMPLATE))
    assert data.neutral and data.examples and data.heldout
