"""Scripts of the 3D view as texts that stand inside a page, so that it needs no network."""

from __future__ import annotations

import base64
import json
from importlib.resources import files

# Name by which the page's script imports a module: its file.
MODULES = {
    "three": "three-0.170.0.module.min.js",
    "three/addons/controls/OrbitControls.js": "OrbitControls-0.170.0.js",
}


def page_scripts() -> dict[str, str]:
    """Contents of the page's script tags.

    Returns
    -------
    dict of str to str
        `import_map`: JSON in which each library is a data URI. `viewer`: the module that draws.
    """
    static = files("handpipe.evaluation.viewer") / "static"
    prefix = "data:text/javascript;base64,"
    encoded = {
        name: prefix + base64.b64encode((static / file).read_bytes()).decode("ascii")
        for name, file in MODULES.items()
    }
    return {
        "import_map": json.dumps({"imports": encoded}),
        "viewer": (static / "viewer.js").read_text(encoding="utf-8"),
    }
