"""Bone surfaces and registered transforms as artifacts hold them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from handpipe.core import InputError, RigidTransform, artifacts
from handpipe.mesh.surfaces import Surface


def write_surfaces(
    path: str | Path, surfaces: Mapping[str, Mapping[str, Surface]], inputs: Sequence[str | Path]
) -> None:
    """Write bone surfaces as an artifact.

    Parameters
    ----------
    path : str or Path
        File to write.
    surfaces : mapping of str to mapping of str to Surface
        Surfaces in mm by bone and part: "marrow", in neutral also "whole".
    inputs : sequence of str or Path
        Files that the surfaces were computed from; the artifact records their hashes.
    """
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
    """One part of each bone's surfaces.

    Parameters
    ----------
    path : str or Path
        Artifact that `write_surfaces` wrote.
    part : str
        "marrow" or "whole".

    Returns
    -------
    dict of str to Surface
        Surface in mm by bone.

    Raises
    ------
    InputError
        As `artifacts.read` does.
    """
    data = artifacts.read(path, "bone_surfaces")
    return {bone: Surface(parts[part]["vertices"], parts[part]["triangles"]) for bone, parts in data.items()}


def read_registration(path: str | Path, needed: Iterable[str] = ()) -> dict[str, RigidTransform]:
    """Transforms of a pose's bones, without their figures.

    Parameters
    ----------
    path : str or Path
        Artifact that `write_registrations` wrote.
    needed : iterable of str, optional
        Bones that the pose must have.

    Returns
    -------
    dict of str to RigidTransform
        Transform from neutral into the pose's frame (mm) by bone.

    Raises
    ------
    InputError
        As `artifacts.read` does, and if the pose lacks one of the bones `needed`.
    """
    data = artifacts.read(path, "registration")
    for bone in needed:
        if bone not in data:
            problem = "was not found in this pose's image, or what was found is doubted; soft tissues need it"
            raise InputError(path, bone, problem, "Correct it by `scribbles` in the dataset file")
    return {bone: RigidTransform(d["rotation"], d["translation"]) for bone, d in data.items()}
