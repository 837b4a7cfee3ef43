"""Fat and water from gradient echoes at several times (Dixon): signal, field map, separation."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.fat_water.echo_images import read_echoes
    from handpipe.imaging.fat_water.echo_signal import EchoSignal
    from handpipe.imaging.fat_water.separation import Separated, separate
else:
    __getattr__ = face(__name__)

__all__ = ["EchoSignal", "Separated", "read_echoes", "separate"]
