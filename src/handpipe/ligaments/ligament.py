"""A ligament as a muscle of its placed template: held by its bones, without strains of its own.

Images show no boundary of a ligament (dark against dark bone), so nothing tells strains apart from what its bones'
motion does to it; the template's shape is kept and the elastic body follows its attachments.
"""

from __future__ import annotations

from collections.abc import Mapping

from handpipe.mesh.rigid import RigidTransform
from handpipe.muscles.body import Body
from handpipe.muscles.muscle import Muscle
from handpipe.muscles.templates import Guess

EDGE = 0.9  # mm, of its tetrahedra


def make_ligament(name: str, guess: Guess, parents: Mapping[str, str], neutral: str) -> Muscle:
    """The ligament of a placed template; parents: bone -> parent bone; neutral: the pose's name."""
    body = Body.of(guess.surface, guess.attachments, EDGE)
    nothing: dict[str, dict[str, RigidTransform]] = {}
    return Muscle.of(name, body, parents, neutral, nothing, [])
