"""A tissue at rest in a frame: from starts with contact planes, then with its skin behind a barrier."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.tissues.fat.resting.from_starts import LOST, at_rest, opened, settled_from
    from handpipe.tissues.fat.resting.load_case import CONTACTS, OPTIONS, LoadCase
    from handpipe.tissues.fat.resting.pressures import pressures_at
    from handpipe.tissues.fat.resting.skin_barrier import behind, kept_apart, penetration
else:
    __getattr__ = face(__name__)

__all__ = [
    "CONTACTS",
    "LOST",
    "OPTIONS",
    "LoadCase",
    "at_rest",
    "behind",
    "kept_apart",
    "opened",
    "penetration",
    "pressures_at",
    "settled_from",
]
