"""What a training set holds: its shards, frames that failed, names, units, licence."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import Array, InputError, IntArray, Shapes, artifacts, atomic
from handpipe.hand import UNITS, surfaces_once
from handpipe.levels.shards.shard import SPLITS
from handpipe.levels.training_set import RIGID_LAYER
from handpipe.skeleton.drivers import LANDMARKS, LandmarkMap
from handpipe.skeleton.rig import Rig

FORMAT, VERSION = "handpipe-training-set", 1


@dataclass(frozen=True)
class ShardIndex:
    """The index of a training set.

    Parameters
    ----------
    made : mapping of str to Any
        What it was made of: subject, hand, scene, level, random poses, licence, commits.
    rig : Rig
        Rig that moved the frames.
    landmarks : LandmarkMap
        Where landmarks are on it.
    """

    made: Mapping[str, Any]
    rig: Rig
    landmarks: LandmarkMap

    def write(self, path: str | Path, shards: Sequence[Path], bodies: Path) -> None:
        """Write the index beside its shards.

        Parameters
        ----------
        path : path
            JSON file to be written.
        shards : sequence of path
            Files of `Shard.write` in their order.
        bodies : path
            File of `write_bodies`.

        Raises
        ------
        InputError
            If a shard cannot be read.
        """
        entries, invalid, figures = [], [], dict[str, str]()
        splits = dict.fromkeys(SPLITS, 0)
        for shard in shards:
            entry, lost, names = self._entry(shard)
            entries.append(entry)
            invalid += lost
            figures |= {name: _unit(name) for name in names}
            for split, count in entry["splits"].items():
                splits[split] += count
        with np.load(bodies) as known:
            shapes = [name.removesuffix("/rest") for name in known.files if name.endswith("/rest")]
            vertices = {name: len(known[f"{name}/rest"]) for name in shapes}
        content = {
            "format": FORMAT,
            "version": VERSION,
            **self.made,
            "units": {"lengths": "mm", "angles": "rad", "figures": figures},
            "frame": "neutral image's frame of the subject, the root bone at rest",
            "angles": {name: list(self.rig.limits[name]) for name in self.rig.angle_names},
            "bones": list(self.rig.bones),
            "parents": self.rig.parents,
            "landmarks": list(LANDMARKS),
            "absent_landmarks": [name for name in LANDMARKS if name not in self.landmarks.places],
            "bodies": {"file": bodies.name, "vertices": vertices},
            "splits": splits,
            "frames": sum(entry["frames"] for entry in entries),
            "shards": entries,
            "invalid": invalid,
        }
        artifacts.write_text(path, json.dumps(content, indent=1))

    def _entry(self, shard: Path) -> tuple[dict[str, Any], list[dict[str, Any]], list[str]]:
        """What the index says of one shard, its failed frames, and the names of its figures."""
        try:
            with np.load(shard) as arrays:
                split, numbers = arrays["split"], arrays["number"]
                keys = ("number", "name", "layer", "reason")
                columns = [arrays[f"invalid/{key}"].tolist() for key in keys]
                figures = [n.removeprefix("figures/") for n in arrays.files if n.startswith("figures/")]
        except (OSError, ValueError, KeyError) as error:
            remedy = "Delete it and run the workflow again"
            raise InputError(shard, "content", f"is no shard ({error})", remedy) from error
        lost = [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]
        counts = {name: int((split == name).sum()) for name in dict.fromkeys(SPLITS)}
        entry = {
            "file": shard.name,
            "sha256": artifacts.content_hash(shard),
            "frames": len(numbers),
            "invalid": len(lost),
            "splits": counts,
        }
        return entry, lost, figures


def write_bodies(path: str | Path, rig: Rig, layers: Mapping[str, Shapes]) -> None:
    """Write what all frames share: `{layer}/{body}/rest` (n, 3) in mm and `…/cells` (k, 3) or (k, 2).

    Parameters
    ----------
    path : path
        Archive of NumPy to be written.
    rig : Rig
        Rig, whose bones are bodies of the layer `bones`.
    layers : mapping of str to Shapes
        Shapes of any frame by layer and body.
    """
    arrays: dict[str, Array | IntArray] = {}
    for bone in rig.bones:
        surface, body = rig.surfaces[bone], f"{RIGID_LAYER}/{bone}"
        arrays |= {f"{body}/rest": surface.vertices, f"{body}/cells": surface.triangles}
    for layer, body, shape in surfaces_once(layers):
        if layer != RIGID_LAYER:
            arrays |= {f"{layer}/{body}/rest": shape.rest, f"{layer}/{body}/cells": shape.cells}
    with atomic(path) as temporary:
        np.savez_compressed(temporary, **arrays)  # type: ignore[arg-type]


def _unit(figure: str) -> str:
    """Unit of a figure, whose name begins with its layer's."""
    return next((unit for name, unit in UNITS.items() if figure.endswith(f"_{name}")), "1")
