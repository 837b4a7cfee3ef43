"""The example of Albrecht 2003: contractions of muscles move a hand whose skin has some 1,500 nodes."""

from __future__ import annotations

import time

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.levels.springs import skin_and_muscles
from benchmarks.levels.subject import ROOT, Subject
from handpipe.core import Metrics
from handpipe.levels import FastSkeleton
from handpipe.levels.mass_spring import SpringHand
from handpipe.mesh.generation import remesh
from handpipe.skeleton.motion import expand_motion
from handpipe.tissues.fat import Rigid, Skin

NODES = 1700  # Albrecht 2003 §6: about 1,500 nodes and 4,500 springs, 5 to 10 frames a second
MOTION = ROOT / "config/scenes/typing.csv"
REPEATS = 5  # of a timing, of which the median counts


def example(subject: Subject) -> Metrics:
    """Seconds of a frame from contractions to skin, on one core, and what the coarse skin has."""
    skin, muscles = skin_and_muscles(subject)
    hand = SpringHand.of(subject.rig, coarser(skin), muscles)
    skeleton, names = FastSkeleton.of(subject.rig), subject.rig.angle_names
    seconds = []
    for _ in range(REPEATS + 1):  # the first one compiles
        begun = time.process_time()
        frames = expand_motion(MOTION, subject.rig).frames
        driven = time.process_time()
        for angles in frames.values():
            hand.posed(skeleton.motions(np.array([angles[name] for name in names])))
        seconds.append((driven - begun, time.process_time() - driven))
    drive, pose = np.median(seconds[1:], axis=0) / len(frames)
    return {
        "albrecht_nodes": (float(len(hand.skin.vertices)), "nodes"),
        "albrecht_springs": (float(len(hand.springs.springs.ends)), "springs"),
        "albrecht_contraction_seconds": (float(drive), "s"),
        "albrecht_pose_seconds": (float(pose), "s"),
        "albrecht_frames_per_second": (float(1 / (drive + pose)), "1/s"),
    }


def coarser(skin: Skin) -> Skin:
    """The skin with about as many nodes as Albrecht 2003 has."""
    fine = skin.surface
    edge = float(fine.edge_lengths().mean()) * np.sqrt(len(fine.vertices) / NODES)
    surface = remesh(fine, edge)
    nearest = cKDTree(fine.vertices).query(surface.vertices)[1]
    parts = {
        name: Rigid(part.bone, np.flatnonzero(np.isin(nearest, part.vertices)))
        for name, part in skin.rigid.items()
    }
    return Skin(surface, parts)
