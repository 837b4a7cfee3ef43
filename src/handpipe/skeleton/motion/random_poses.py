"""Random valid poses, from which cheap hands are learned, as a YAML file.

random:
  count: 100
  seed: 0
  around: limits         # evenly within the joints' limits; scans: mixtures of scanned poses
  spread: 0.15           # of scans: shares of each angle's limits by which a mixture is disturbed
  seeds: one             # for all poses in turn; each: a pose is drawn of the seed and its number alone
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from handpipe.core import Array, InputError, read_text
from handpipe.core.configuration import Model, load_yaml
from handpipe.skeleton.motion.motion import Motion
from handpipe.skeleton.posing.validity import PoseValidity
from handpipe.skeleton.rig.rig import Rig

EVEN = 0.5  # Dirichlet's parameter: most mixtures are of a few poses, some of one nearly alone
TRIES = 100  # poses that are drawn for one without collisions, at most


class RandomPoses(Model):
    """Which random poses."""

    count: int = Field(ge=1, description="number of poses")
    seed: int = Field(0, ge=0, description="of their choice")
    around: Literal["limits", "scans"] = "limits"
    spread: float = Field(0.15, ge=0, le=1, description="share of each angle's limits, around scans")
    seeds: Literal["one", "each"] = Field(default="one", description="of all poses, or of each pose")


class RandomFile(Model):
    """The file's only field."""

    random: RandomPoses


def is_random_file(path: str | Path) -> bool:
    """Whether a YAML file asks for random poses.

    Parameters
    ----------
    path : str or Path
        YAML file.

    Returns
    -------
    bool
    """
    return re.search(r"^random\s*:", read_text(path), re.MULTILINE) is not None


def read_random_file(path: str | Path) -> RandomPoses:
    """Which random poses a file asks for.

    Parameters
    ----------
    path : str or Path
        YAML file.

    Returns
    -------
    RandomPoses
        Their number, seed and kind.

    Raises
    ------
    InputError
        If the file is wrong.
    """
    return load_yaml(path, RandomFile).random


def random_names(path: str | Path) -> list[str]:
    """Names of the poses that a file asks for."""
    return numbered(read_random_file(path).count)


def numbered(count: int) -> list[str]:
    """Names of a number of random poses."""
    return [f"random{i}" for i in range(1, count + 1)]


def read_random_poses(path: str | Path, rig: Rig) -> Motion:
    """Random poses within limits, without those in which bones collide.

    Parameters
    ----------
    path : str or Path
        YAML file.
    rig : Rig
        Rig that is posed.

    Returns
    -------
    Motion
        A frame a pose.

    Raises
    ------
    InputError
        If the file is wrong, or bones collide in nearly all poses.
    """
    return draw_poses(read_random_file(path), rig, path)


def draw_poses(asked: RandomPoses, rig: Rig, source: str | Path = "random poses") -> Motion:
    """Random poses within limits, without those in which bones collide.

    Parameters
    ----------
    asked : RandomPoses
        How many and which poses.
    rig : Rig
        Rig that is posed.
    source : path
        What an error names.

    Returns
    -------
    Motion
        A frame a pose.

    Raises
    ------
    InputError
        If bones collide in nearly all poses.
    """
    names, validity = numbered(asked.count), PoseValidity(rig)
    if asked.seeds == "each":
        return _of_own_seeds(asked, names, validity, source)
    rng = np.random.default_rng(asked.seed)
    found: dict[str, dict[str, float]] = {}
    for tried in range(TRIES * asked.count):
        if len(found) == asked.count:
            return Motion(found, said=[f"{tried - len(found)} poses with colliding bones were left out"])
        values = _drawn(asked, rig, rng)
        pose = dict(zip(rig.angle_names, map(float, values), strict=True))
        if not validity.check(pose).collisions:
            found[names[len(found)]] = pose
    problem = f"bones collide in all but {len(found)} of {TRIES * asked.count} poses"
    raise InputError(source, "random", problem, "Say `around: scans`, or a smaller spread")


def _of_own_seeds(asked: RandomPoses, names: list[str], validity: PoseValidity, source: str | Path) -> Motion:
    """Poses of which each is drawn from the seed and its own number."""
    found, rig, left_out = {}, validity.rig, 0
    for number, name in enumerate(names):
        rng = np.random.default_rng([asked.seed, number])
        for tried in range(TRIES):
            pose = dict(zip(rig.angle_names, map(float, _drawn(asked, rig, rng)), strict=True))
            if not validity.check(pose).collisions:
                found[name], left_out = pose, left_out + tried
                break
        else:
            problem = f"bones collide in {TRIES} poses that were drawn for {name}"
            raise InputError(source, "random", problem, "Say `around: scans`, or a smaller spread")
    return Motion(found, said=[f"{left_out} poses with colliding bones were left out"])


def _drawn(asked: RandomPoses, rig: Rig, rng: np.random.Generator) -> Array:
    """Angles (a,) of one pose in rad."""
    lower, upper = np.array([rig.limits[name] for name in rig.angle_names], float).reshape(-1, 2).T
    if asked.around == "limits":
        return rng.uniform(lower, upper)
    scanned = np.array([[pose.angles[n] for n in rig.angle_names] for pose in rig.poses.values()])
    mixture = rng.dirichlet(np.full(len(scanned), EVEN)) @ scanned
    half = asked.spread / 2
    return np.clip(mixture + (upper - lower) * rng.uniform(-half, half, len(lower)), lower, upper)
