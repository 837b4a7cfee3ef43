"""Real anatomy that moves and is imaged as phantoms are: MyoHand and Z-Anatomy."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.real_anatomy.source_meshes import folder_of
else:
    __getattr__ = face(__name__)

__all__ = ["folder_of"]
