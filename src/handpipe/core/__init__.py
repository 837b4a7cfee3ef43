"""What every package stands on: errors, arrays, artifacts, metrics, paths, layers, rigid motions."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.core import artifacts, configuration, metrics, paths, robust
    from handpipe.core.arrays import Array, BoolArray, Int32Array, IntArray, evenly, unit_vectors
    from handpipe.core.artifacts import atomic, identity, read_text, write_text
    from handpipe.core.code_digest import CodeDigests
    from handpipe.core.command import Parser, number, reported, run, whole_number
    from handpipe.core.errors import ConvergenceError, HandpipeError, InputError, plain
    from handpipe.core.layer_registry import (
        LAYERS,
        Look,
        artifacts_of,
        inner_layers,
        looks,
        made,
        needed,
        organs,
        under_fat,
    )
    from handpipe.core.layers import (
        FollowingLayer,
        Frame,
        Layer,
        Region,
        Shape,
        Shapes,
        SimulatedFrame,
        flesh_in,
        vertices_of,
        without_sliding,
    )
    from handpipe.core.metrics import Metrics
    from handpipe.core.rigid import RigidTransform, left_jacobian
else:
    __getattr__ = face(__name__)

__all__ = [
    "Array",
    "BoolArray",
    "CodeDigests",
    "ConvergenceError",
    "FollowingLayer",
    "Frame",
    "HandpipeError",
    "InputError",
    "Int32Array",
    "IntArray",
    "LAYERS",
    "Layer",
    "Look",
    "Metrics",
    "Parser",
    "Region",
    "RigidTransform",
    "Shape",
    "Shapes",
    "SimulatedFrame",
    "artifacts",
    "artifacts_of",
    "atomic",
    "configuration",
    "evenly",
    "flesh_in",
    "identity",
    "inner_layers",
    "left_jacobian",
    "looks",
    "made",
    "metrics",
    "needed",
    "number",
    "organs",
    "paths",
    "plain",
    "read_text",
    "reported",
    "robust",
    "run",
    "under_fat",
    "unit_vectors",
    "vertices_of",
    "whole_number",
    "without_sliding",
    "write_text",
]
