"""JSON schemas of the files that people write, so that editors can check and complete them.

`python -m handpipe.core.configuration.schema workflow/schemas` writes them anew after a change of
the models of this package.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from handpipe.core.artifacts import write_text
from handpipe.core.command import Parser, reported
from handpipe.core.configuration.dataset import Dataset
from handpipe.core.configuration.model import Model
from handpipe.core.configuration.scene import Scene
from handpipe.core.configuration.settings import Settings

MODELS: dict[str, type[Model]] = {"config": Settings, "dataset": Dataset, "scene": Scene}


def schema(name: str) -> str:
    """The JSON schema of a kind of file, as text."""
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    found = MODELS[name].model_json_schema()
    if name == "dataset":  # one that is like another need not have everything itself
        whole, alike = found.pop("required"), ["name", "root", "like"]
        found["anyOf"] = [{"required": whole}, {"required": alike}]
    return json.dumps(dialect | found, indent=2) + "\n"


def write_schemas(folder: str | Path) -> list[Path]:
    """Write `{name}.schema.json` for every kind of file; return the paths."""
    paths = [Path(folder) / f"{name}.schema.json" for name in MODELS]
    for name, path in zip(MODELS, paths, strict=True):
        write_text(path, schema(name))
    return paths


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the schemas into a folder; 0 if it succeeded, 1 with a line that says why not."""
    parser = Parser(prog="python -m handpipe.core.configuration.schema", description=__doc__)
    parser.add_argument("folder", type=Path, help="workflow/schemas")
    options = parser.parse_args(arguments)
    with reported() as failure:
        for written in write_schemas(options.folder):
            print(written)
    return failure.code


if __name__ == "__main__":
    sys.exit(main())
