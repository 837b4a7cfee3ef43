"""The finger's bodies that slide on one another, at rest."""

from __future__ import annotations

import logging
from pathlib import Path

from handpipe.synthetic.coupled import anatomy_file
from handpipe.synthetic.sliding import finger_bodies

log = logging.getLogger(__name__)


def sliding_body(output: Path) -> None:
    """The finger's bodies that slide on one another, at rest."""
    anatomy = finger_bodies.build().anatomy
    log.info("%d tets, %d vertices", len(anatomy.mesh.tets), len(anatomy.mesh.vertices))
    anatomy_file.save(output, anatomy)
