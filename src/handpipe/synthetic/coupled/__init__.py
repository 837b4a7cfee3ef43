"""The coupled truth: muscles, fat and skin as one body about moving bones."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.coupled import anatomy_file
    from handpipe.synthetic.coupled.validation import patch_test, volume_changes
else:
    __getattr__ = face(__name__)

__all__ = ["anatomy_file", "patch_test", "volume_changes"]
