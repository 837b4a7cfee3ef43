"""The skin in a volume: the body's edge below the voxel size, closed, its parts told apart where they touch."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.skin.contacts import PosedBones
    from handpipe.imaging.skin.volume_skin import VolumeSkin, skin_of_volume
else:
    __getattr__ = face(__name__)

__all__ = ["PosedBones", "VolumeSkin", "skin_of_volume"]
