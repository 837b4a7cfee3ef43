"""Muscles' intermediate artifacts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from handpipe.core import artifacts
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.muscles.fitting import PlacedTemplate, SoftBody


def read_guesses(path: Path, names: Iterable[str]) -> dict[str, PlacedTemplate]:
    """Placed templates by name."""
    data = artifacts.read(path, "placed_templates")
    guesses = {}
    for name in names:
        d = data[name]
        marks = {label: int(vertex) for label, vertex in d.get("landmarks", {}).items()}
        guesses[name] = PlacedTemplate(Surface(d["vertices"], d["triangles"]), dict(d["attachments"]), marks)
    return guesses


def write_bodies(path: Path, bodies: Mapping[str, SoftBody], inputs: Sequence[Path]) -> None:
    """Neutral bodies by muscle."""
    units = {f"{name}/vertices": "mm" for name in bodies} | {f"{name}/mesh/vertices": "mm" for name in bodies}
    data = {name: body.to_group() for name, body in bodies.items()}
    artifacts.write(path, data, kind="muscle_bodies", units=units, inputs=inputs)


def read_bodies(path: Path) -> dict[str, SoftBody]:
    """What `write_bodies` wrote."""
    return {name: SoftBody.from_group(group) for name, group in artifacts.read(path, "muscle_bodies").items()}
