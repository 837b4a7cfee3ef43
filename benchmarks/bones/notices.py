"""What the library says of its own accord: warnings that it logs, and errors that a person should read."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from handpipe.core import HandpipeError


class _Listener(logging.Handler):
    def __init__(self, heard: list[str]) -> None:
        super().__init__(logging.WARNING)
        self.heard = heard

    def emit(self, record: logging.LogRecord) -> None:
        self.heard.append(record.getMessage())


@contextmanager
def listening(heard: list[str]) -> Iterator[None]:
    """Add to `heard` what is said inside the block; an error for people ends the block, no more."""
    logger, listener = logging.getLogger("handpipe"), _Listener(heard)
    usual = logger.level
    logger.addHandler(listener)
    logger.setLevel(logging.WARNING)  # whatever the rest of the process cares to hear
    try:
        yield
    except HandpipeError as error:
        heard.append(str(error))
    finally:
        logger.setLevel(usual)
        logger.removeHandler(listener)
