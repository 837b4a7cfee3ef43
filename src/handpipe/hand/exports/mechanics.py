"""Strains, stresses, fibre stretch and contact pressure of simulated frames, as fields of their shapes."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from handpipe.anatomy.templates import harmonic_fibres
from handpipe.core import Array, Frame, IntArray, Layer, RigidTransform, Shapes
from handpipe.fem.elements import green_strains, plasticity, von_mises
from handpipe.fem.potentials import Elastic
from handpipe.hand.frames import ComputedFrames
from handpipe.hand.simulation import SimulatedFrame
from handpipe.tissues.muscles import Muscle, MuscleLayer

log = logging.getLogger(__name__)

Fields = dict[str, NDArray]


@runtime_checkable
class Mechanical(Protocol):
    """A layer that tells the potentials of its tets and the contact of its bodies."""

    name: str

    def elastic_bodies(self, bones: Mapping[str, RigidTransform]) -> dict[str, Elastic]:
        """The potential of each body of tets in a pose, by the body's name."""
        ...

    def contact_pressures(self, frame: Frame, shapes: Mapping[str, Shapes]) -> dict[str, dict[str, Array]]:
        """Contact pressures (v,) in kPa on the vertices of bodies, by layer and body."""
        ...


def with_mechanics(
    frames: Sequence[SimulatedFrame], layers: Sequence[Layer], parents: Mapping[str, str]
) -> Sequence[SimulatedFrame]:
    """Frames with the bodies alone that have mechanical fields, and these fields.

    Tets have `green_strain` E = (F^T F - I) / 2 of the whole deformation F, `elastic_green_strain` of
    F_e = F F_p^-1, `plastic_deformation` F_p, and `cauchy_stress` in kPa, all with nine components row by
    row, and `von_mises_stress` in kPa. Tets of muscles have `fibre_direction`, a unit vector at rest, and
    `fibre_stretch`, that of the whole deformation. Vertices of surfaces have `contact_pressure` in kPa.

    Parameters
    ----------
    frames : sequence of SimulatedFrame
        Frames at equilibrium.
    layers : sequence of Layer
        The layers that simulated them.
    parents : mapping of str to str
        Parent of each bone but the root. A muscle's fibres go to the bone farthest from the root.

    Returns
    -------
    sequence of SimulatedFrame
        The frames, each computed when it is asked for; the shapes keep no other field but `occupancy`.
    """
    fibres = muscle_fibres(layers, parents)
    mechanical = [layer for layer in layers if isinstance(layer, Mechanical)]
    return ComputedFrames(frames, lambda frame, shapes: _of_frame(frame, shapes, mechanical, fibres))


def _of_frame(
    frame: Frame, shapes: Mapping[str, Shapes], layers: Sequence[Mechanical], fibres: Mapping[str, Array]
) -> dict[str, Shapes]:
    found: dict[str, Shapes] = {}
    for layer in layers:
        if layer.name not in shapes:
            continue
        for body, elastic in layer.elastic_bodies(frame.bones).items():
            shape = shapes[layer.name][body]
            fields = tet_fields(elastic, shape.vertices, fibres.get(body))
            kept = {n: v for n, v in shape.fields.items() if n == "occupancy"}
            found.setdefault(layer.name, {})[body] = replace(shape, fields=kept | fields)
        for owner, pressures in layer.contact_pressures(frame, shapes).items():
            for body, pressure in pressures.items():
                touched = replace(shapes[owner][body], fields={"contact_pressure": pressure})
                found.setdefault(owner, {})[body] = touched
    return found


def tet_fields(elastic: Elastic, x: Array, fibres: Array | None = None) -> Fields:
    """Strains and stresses of a body's tets, as `with_mechanics` names them.

    Parameters
    ----------
    elastic : Elastic
        The body's potential, m tets.
    x : array (n, 3)
        Vertices in mm.
    fibres : array (m, 3), optional
        Unit directions of fibres at rest.

    Returns
    -------
    dict of str to array
        Fields: (m, 9), (m, 3) or (m,).
    """
    f, stress = elastic.deformation_gradients(x), elastic.cauchy_stresses(x)
    tensors = {
        "green_strain": green_strains(f),
        "elastic_green_strain": green_strains(elastic.elastic_gradients(x)),
        "plastic_deformation": plasticity.to_matrices(elastic.strains),
        "cauchy_stress": stress,
    }
    fields: Fields = {name: values.reshape(-1, 9) for name, values in tensors.items()}
    fields["von_mises_stress"] = von_mises(stress)
    if fibres is not None:
        fields["fibre_direction"] = fibres
        fields["fibre_stretch"] = np.linalg.norm(np.einsum("mij,mj->mi", f, fibres), axis=1)
    return fields


def muscle_fibres(layers: Sequence[Layer], parents: Mapping[str, str]) -> dict[str, Array]:
    """Fibre directions of muscles that are attached to two bones or more.

    Fibres follow the harmonic flow from the attachments to other bones towards those to the bone that is
    farthest from the root.

    Parameters
    ----------
    layers : sequence of Layer
        Layers; those of muscles count.
    parents : mapping of str to str
        Parent of each bone but the root.

    Returns
    -------
    dict of str to array (m, 3)
        Unit directions at rest by the name of the tets' shape. Muscles without two ends are missing.
    """
    contracting = [x for x in layers if isinstance(x, MuscleLayer) and x.name == MuscleLayer.name]
    muscles = [muscle for layer in contracting for muscle in layer.muscles]
    found = {}
    for muscle in muscles:
        origin, insertion = _ends(muscle, parents)
        if len(origin) and len(insertion):
            found[f"{muscle.name}_mesh"] = harmonic_fibres(muscle.body.mesh, origin, insertion)
        else:
            log.warning("%s: no fibre stretch: it is not attached to two bones", muscle.name)
    return found


def _ends(muscle: Muscle, parents: Mapping[str, str]) -> tuple[IntArray, IntArray]:
    """Mesh vertices next to what is attached to the bone farthest from the root, last, and to the others."""
    embedding = muscle.body.embedding
    nearest = np.take_along_axis(embedding.cells, embedding.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    ends = {bone: np.unique(nearest[ids]) for bone, ids in muscle.body.attachments.items() if len(ids)}
    if len(ends) < 2:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    *others, last = sorted(ends, key=lambda bone: _depth(bone, parents))
    origin = np.unique(np.concatenate([ends[bone] for bone in others]))
    return np.setdiff1d(origin, ends[last]), np.setdiff1d(ends[last], origin)


def _depth(bone: str, parents: Mapping[str, str]) -> int:
    """Number of joints between a bone and the root."""
    depth = 0
    while bone in parents:
        bone, depth = parents[bone], depth + 1
    return depth
