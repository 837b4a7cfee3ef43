"""Errors whose texts are written for the person who runs a build."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path


class HandpipeError(Exception):
    """Something that a person can mend; its text says where and how."""


class InputError(HandpipeError):
    """An input is missing, malformed or out of range.

    Parameters
    ----------
    source : path
        The file, or another origin.
    field : str
        The part of it that is wrong.
    problem : str
        What is wrong with that part.
    remedy : str
        What a person can do about it.
    """

    def __init__(self, source: str | Path, field: str, problem: str, remedy: str) -> None:
        self.source, self.field, self.problem, self.remedy = str(source), field, problem, remedy
        super().__init__(f"{source}: {field}: {problem}. {remedy}")


class ConvergenceError(HandpipeError):
    """A solver did not reach a solution; its result is discarded.

    Parameters
    ----------
    what : str
        What did not converge.
    reason : str
        Why it did not.
    remedy : str
        What a person can do about it, one sentence.
    """

    def __init__(self, what: str, reason: str, remedy: str = "See the log for its residuals.") -> None:
        self.what, self.reason, self.remedy = what, reason, remedy
        super().__init__(f"{what} did not converge: {reason.rstrip('. ')}. {remedy}")

    def within(self, whole: str) -> ConvergenceError:
        """The same failure, reported for a whole of which `what` is a part; the remedy is said once."""
        return ConvergenceError(whole, f"{self.what.lower()}: {self.reason}", self.remedy)


def plain(error: BaseException) -> str:
    """What a person reads of an error, in one line.

    Parameters
    ----------
    error : exception
        Any error. A full disk, missing memory and the like are put in plain words; other errors from outside
        of handpipe are named as unexpected.

    Returns
    -------
    str
    """
    if isinstance(error, HandpipeError):
        return " ".join(str(error).split())
    refusal = refused_by_system(error)
    if refusal:
        return refusal
    return (
        f"unexpected {type(error).__name__}: {_first_line(error)}. This is a fault of handpipe or its setup"
    )


def refused_by_system(error: BaseException) -> str | None:
    """What the system refused, where an error arose from that.

    Parameters
    ----------
    error : exception
        Any error.

    Returns
    -------
    str or None
        The problem, what to do and the path, in one line. None where no room, right or memory was missing.
    """
    for cause in _causes(error):
        for number, words in NO_ROOM.items():
            # HDF5 gives the number only in its text
            if getattr(cause, "errno", None) == number or f"errno = {number}," in str(cause):
                return f"{words}{_named_path(cause)}"
        if isinstance(cause, MemoryError):
            return f"not enough memory ({_first_line(cause)}). Use fewer jobs at a time or larger edges"
    return None


# A file that permissions keep closed, or that another user owns.
NOT_PERMITTED = "a file or folder may not be accessed. Check its permissions"
NO_ROOM = {
    errno.ENOSPC: "no space left on the disk. Free some and run the same command again",
    errno.EDQUOT: "the disk quota is used up. Free some space and run the same command again",
    errno.EROFS: "the disk is read-only. Build in a folder that you may write to",
    errno.EACCES: NOT_PERMITTED,
    errno.EPERM: NOT_PERMITTED,
    errno.EMFILE: "too many open files. Raise the limit (ulimit -n)",
}


def _causes(error: BaseException) -> Iterator[BaseException]:
    """The error and the errors that caused it."""
    found: BaseException | None = error
    while found is not None:
        yield found
        found = found.__cause__ or found.__context__


def _named_path(error: BaseException) -> str:
    """A sentence on the path that the system refused, where the system names one."""
    # the target of a renaming is what a person knows: its source is a temporary file
    name = getattr(error, "filename2", None) or getattr(error, "filename", None)
    return f". The path is {os.fsdecode(name)}" if isinstance(name, str | bytes | os.PathLike) else ""


def _first_line(error: BaseException) -> str:
    return next(iter(str(error).splitlines()), "").rstrip(". ")
