"""Bone surfaces and registered transforms as artifacts hold them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from handpipe.core import InputError, RigidTransform, artifacts
from handpipe.mesh.surfaces import Surface


def write_surfaces(
    path: str | Path, surfaces: Mapping[str, Mapping[str, Surface]], inputs: Sequence[str | Path]
) -> None:
    """Write surfaces by bone and part ("marrow", in neutral also "whole")."""
    data = {
        bone: {part: {"vertices": s.vertices, "triangles": s.triangles} for part, s in parts.items()}
        for bone, parts in surfaces.items()
    }
    artifacts.write(
        path, data, kind="bone_surfaces", units=dict.fromkeys(_vertex_keys(surfaces), "mm"), inputs=inputs
    )


def _vertex_keys(surfaces: Mapping[str, Mapping[str, Surface]]) -> list[str]:
    return [f"{bone}/{part}/vertices" for bone, parts in surfaces.items() for part in parts]


def read_surfaces(path: str | Path, part: str) -> dict[str, Surface]:
    """One part of each bone's surfaces, by bone."""
    data = artifacts.read(path, "bone_surfaces")
    return {bone: Surface(parts[part]["vertices"], parts[part]["triangles"]) for bone, parts in data.items()}


def read_registration(path: str | Path, needed: Iterable[str] = ()) -> dict[str, RigidTransform]:
    """Transforms from neutral into a pose's frame, by bone.

    Raises `InputError` where one of the bones `needed` is missing in the pose.
    """
    data = artifacts.read(path, "registration")
    for bone in needed:
        if bone not in data:
            problem = "was not found in this pose's image, or what was found is doubted; soft tissues need it"
            raise InputError(path, bone, problem, "Correct it by `scribbles` in the dataset file")
    return {bone: RigidTransform(d["rotation"], d["translation"]) for bone, d in data.items()}
