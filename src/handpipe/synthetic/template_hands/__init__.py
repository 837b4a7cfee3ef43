"""Complete hands, built on phantoms or on real anatomy: organs, templates, attachments, coupled bodies."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.template_hands import coupled_hand, zanatomy_hand
    from handpipe.synthetic.template_hands.known_hands import known_hand
    from handpipe.synthetic.template_hands.muscle_ends import marked_ends
    from handpipe.synthetic.template_hands.template_hand import at_its_size, bare_hand, of_build
else:
    __getattr__ = face(__name__)

__all__ = [
    "at_its_size",
    "bare_hand",
    "coupled_hand",
    "known_hand",
    "marked_ends",
    "of_build",
    "zanatomy_hand",
]
