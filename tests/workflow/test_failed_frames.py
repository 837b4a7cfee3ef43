"""A frame that fails is named; the others are exported; the next build simulates the failed frame alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pygltflib
import pytest
import trimesh

from handpipe import metrics
from handpipe.hand.frames import read_simulated
from handpipe.mesh.surface import Surface
from handpipe.skeleton.joint_types import JointFit
from handpipe.skeleton.rig import FittedPose, Joint, Rig

from .running import run

RULES = ("simulate", "evaluate_frames", "export_scene", "export_obj", "require_simulation", "simulation")
BUILD = ("-j2", "simulation", "--config", "subjects=[small]", "scenes=[close]", "--allowed-rules", *RULES)
BASE = "results/small/simulation/close"
FAILS = """
    from handpipe.errors import ConvergenceError
    for layer in made:
        def solve(frame, below, solve=layer.solve):
            print(frame.name, file=open("solved.txt", "a"))
            if frame.name == "a {bad}/..one" and not Path("mended").exists():
                raise ConvergenceError("Tendon x", "no luck")
            return solve(frame, below)
        layer.solve = solve
    return made
"""
