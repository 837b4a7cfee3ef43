"""Processor seconds of an edit of one muscle, from the file's content to the surfaces that are drawn."""

from __future__ import annotations

import time
from importlib.resources import files
from typing import Any

import numpy as np
import yaml

from handpipe.anatomy.editing import CurveEditor
from handpipe.anatomy.templates import Domain
from handpipe.anatomy.templates.curves import CurveFile
from handpipe.core import Metrics
from handpipe.fem.linear import factorise
from handpipe.synthetic.geometry import leg_surfaces

DOMAINS = {"100k": (1.2, 6.0), "640k": (1.6, 3.03)}  # how much finer surfaces are, and mm of tets' edges
DRAGS, STEP = 5, 6.0  # of the point, in mm: across several tets, as a fast hand drags
DRAGGED, SPREAD = "tibialis_anterior", "soleus"


def measure() -> Metrics:
    """Largest seconds of several drags by size of the domain, and of other edits."""
    found: Metrics = {}
    for size, (finer, edge) in DOMAINS.items():
        found |= {f"edit_{name}_{size}": figure for name, figure in _edits(finer, edge).items()}
    return found


def _edits(finer: float, edge: float) -> Metrics:
    skin, bones = leg_surfaces(finer)
    domain = Domain.between(skin, bones, edge)
    start = time.process_time()
    editor = CurveEditor(domain, skin, bones, factorise=factorise)
    editor.edit(CurveFile.model_validate(_leg()))
    opened = time.process_time() - start
    drags = [_seconds(editor, _leg(down=STEP * (i + 1))) for i in range(DRAGS)]
    undone = _seconds(editor, _leg())
    _seconds(editor, _leg(spread=1.9))  # makes what all muscles with spread share
    spread = _seconds(editor, _leg(spread=2.0))
    beside = _seconds(editor, _leg(spread=2.0, down=STEP))
    return {
        "tets": (float(len(domain.mesh.tets)), "1"),
        "opening_seconds": (opened, "s"),
        "seconds": (max(drags), "s"),
        "undo_seconds": (undone, "s"),
        "spread_seconds": (spread, "s"),
        "beside_spread_seconds": (beside, "s"),
    }


def _seconds(editor: CurveEditor, content: dict[str, Any]) -> float:
    start = time.process_time()
    editor.edit(CurveFile.model_validate(content))
    return time.process_time() - start


def _leg(down: float = 0.0, spread: float = 1.0) -> dict[str, Any]:
    """The leg's curves, one point of a muscle lower; one muscle may be flat."""
    text = files("handpipe.synthetic.geometry").joinpath("leg.yaml").read_text(encoding="utf-8")
    content: dict[str, Any] = yaml.safe_load(text)
    for muscle in content["muscles"].values():
        for point in muscle["curves"][0]["points"]:
            point.pop("spread", None)
    points = content["muscles"][DRAGGED]["curves"][0]["points"]
    points[1]["at"] = (np.array(points[1]["at"]) + [down, -down / 2, 0]).tolist()
    content["muscles"][SPREAD]["curves"][0]["points"][1]["spread"] = [1 / spread, spread]
    return content
