"""The anatomy of a coupled body on disk, kind "coupled-anatomy"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from handpipe.core import artifacts
from handpipe.mesh.tets import TetMesh
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, TendonStrand

KIND = "coupled-anatomy"


def save(path: str | Path, anatomy: CoupledAnatomy, inputs: Sequence[str | Path] = ()) -> None:
    """Write an anatomy; lengths in mm, forces in mN."""
    strands = {name: asdict(strand) for name, strand in anatomy.strands.items()}
    for strand in strands.values():
        strand["bones"] = {str(number): bone for number, bone in strand["bones"].items()}
    data = {
        "vertices": anatomy.mesh.vertices,
        "tets": anatomy.mesh.tets,
        "labels": anatomy.labels,
        "regions": list(anatomy.regions),
        "bones": dict(anatomy.bones),
        "fibres": dict(anatomy.fibres),
        "strands": strands,
    }
    units = {"vertices": "mm"}
    units |= {f"strands/{name}/points": "mm" for name in strands}
    artifacts.write(path, data, kind=KIND, units=units, inputs=inputs)


def load(path: str | Path) -> CoupledAnatomy:
    """Read what `save` wrote; `InputError` where that cannot be read."""
    data = artifacts.read(path, KIND)
    strands = {
        name: TendonStrand(
            strand["points"],
            float(strand["stiffness"]),
            {int(number): str(bone) for number, bone in strand["bones"].items()},
            float(strand["radius"]),
            float(strand["tension"]),
        )
        for name, strand in data["strands"].items()
    }
    regions = tuple(str(name) for name in data["regions"])
    mesh = TetMesh(data["vertices"], data["tets"])
    return CoupledAnatomy(mesh, data["labels"], regions, data["bones"], data["fibres"], strands)
