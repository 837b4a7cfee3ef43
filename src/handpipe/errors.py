"""The one family of errors that a person is meant to read."""

from __future__ import annotations

from pathlib import Path


class HandpipeError(Exception):
    """Something that a person can mend; its text says where and how."""


class InputError(HandpipeError):
    """An input is missing, malformed or out of range.

    Parameters: `source` is the file (or other origin), `field` the part of it that is wrong,
    `problem` what is wrong with it, `remedy` what to do.
    """

    def __init__(self, source: str | Path, field: str, problem: str, remedy: str) -> None:
        self.source, self.field, self.problem, self.remedy = str(source), field, problem, remedy
        super().__init__(f"{source}: {field}: {problem}. {remedy}")


class ConvergenceError(HandpipeError):
    """A solver stopped away from a solution; its result is not handed on.

    Parameters: `what` did not converge, the `reason`, and the `remedy`, one sentence.
    """

    def __init__(self, what: str, reason: str, remedy: str = "See the log for its residuals.") -> None:
        self.what, self.reason, self.remedy = what, reason, remedy
        super().__init__(f"{what} did not converge: {reason.rstrip('. ')}. {remedy}")

    def within(self, whole: str) -> ConvergenceError:
        """The same failure as that of a whole of which `what` is a part; the remedy is said once."""
        return ConvergenceError(whole, f"{self.what.lower()}: {self.reason}", self.remedy)
