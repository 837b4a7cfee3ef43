"""Image model from physics: signal equations of tissues, structures of real limbs, scanners' artefacts."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.acquisition.physics.anatomy import ImagedAnatomy
    from handpipe.synthetic.acquisition.physics.effects import Effects
    from handpipe.synthetic.acquisition.physics.scanner import scan
    from handpipe.synthetic.acquisition.physics.sequences import Sequence
else:
    __getattr__ = face(__name__)

__all__ = ["Effects", "ImagedAnatomy", "Sequence", "scan"]
