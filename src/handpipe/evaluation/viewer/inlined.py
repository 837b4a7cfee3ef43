"""Scripts of the 3D view as texts that stand inside a page, so that it needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable

# Name by which the page's script imports a module: its file.
MODULES = {
    "three": "three-0.170.0.module.min.js",
    "three/addons/controls/OrbitControls.js": "OrbitControls-0.170.0.js",
    "space": "space.js",
}


def page_scripts() -> dict[str, str]:
    """Contents of the page's script tags.

    Returns
    -------
    dict of str to str
        `import_map`: JSON in which each module is a data URI. `viewer`: the module that draws.
    """
    return {"import_map": import_map({}), "viewer": (_static() / "viewer.js").read_text(encoding="utf-8")}


def import_map(further: Mapping[str, bytes]) -> str:
    """JSON of an import map in which each module is a data URI.

    Parameters
    ----------
    further : mapping of str to bytes
        Modules beside three.js and what views share, by the names that scripts import.

    Returns
    -------
    str
        Content of the script tag.
    """
    modules = {name: (_static() / file).read_bytes() for name, file in MODULES.items()}
    prefix = "data:text/javascript;base64,"
    encoded = {
        name: prefix + base64.b64encode(text).decode("ascii") for name, text in {**modules, **further}.items()
    }
    return json.dumps({"imports": encoded})


def _static() -> Traversable:
    return files("handpipe.evaluation.viewer") / "static"
