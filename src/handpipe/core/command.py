"""What all command lines share: checks of numbers, and one line that reports a failure."""

from __future__ import annotations

import argparse
import logging
import math
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NoReturn

from handpipe.core.errors import HandpipeError, refused_by_system


class Parser(argparse.ArgumentParser):
    """A parser of command lines that reports a wrong argument in one line, which names the option.

    Parameters
    ----------
    prog, usage, description, epilog, parents, formatter_class, prefix_chars, fromfile_prefix_chars : optional
        As in `argparse.ArgumentParser`.
    argument_default, conflict_handler, add_help, allow_abbrev, exit_on_error : optional
        As in `argparse.ArgumentParser`.
    """

    def error(self, message: str) -> NoReturn:
        """Exits with status 2 after one line that states the error and names `--help`."""
        self.exit(2, f"handpipe: {message}. See {self.prog} --help\n")


def number(lower: float, upper: float) -> Callable[[str], float]:
    """The type of an option that is a finite number in a range.

    Parameters
    ----------
    lower, upper : float
        Least and largest number that is accepted.

    Returns
    -------
    function
        Takes the option's text to the number; it raises `argparse.ArgumentTypeError` for any other text.
    """

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not lower <= value <= upper:
            raise argparse.ArgumentTypeError(f"{text!r} is no number between {lower:g} and {upper:g}")
        return value

    return parse


def whole_number(lower: float, upper: float) -> Callable[[str], int]:
    """The type of an option that is a whole number in a range.

    Parameters
    ----------
    lower, upper : float
        Least and largest number that is accepted.

    Returns
    -------
    function
        Takes the option's text to the number; it raises `argparse.ArgumentTypeError` for any other text.
    """

    def parse(text: str) -> int:
        value = number(lower, upper)(text)
        if value != int(value):
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number")
        return int(value)

    return parse


@dataclass
class ExitCode:
    """The exit code of a command: 0 unless it failed."""

    code: int = 0


@contextmanager
def reported() -> Iterator[ExitCode]:
    """Turn any error of the block into one line for a person and the exit code 1.

    The traceback of an unexpected error is written to a file that the line names.

    Yields
    ------
    ExitCode
        Its `code` is the exit code after the block: 0, or 1 where the block failed.
    """
    failure = ExitCode()
    try:
        yield failure
    except HandpipeError as error:
        failure.code = _said(str(error))
    except MemoryError:
        failure.code = _said("there is not enough memory; close other programs or give a coarser mesh")
    except Exception as error:
        failure.code = _said(refused_by_system(error) or _other_error(error))


def _other_error(error: Exception) -> str:
    """What a person reads of an error; a file keeps the traceback of an unexpected one, if there is room."""
    if isinstance(error, OSError):
        return f"{error.filename or 'file'}: {error.strerror or error}"
    said = f"unexpected {type(error).__name__}: {error}"
    try:
        with tempfile.NamedTemporaryFile("w", prefix="handpipe-", suffix=".log", delete=False) as file:
            traceback.print_exception(error, file=file)
    except OSError as refused:
        return f"{said}. No log was written: {refused.strerror or refused}"
    return f"{said}. The log is {file.name}"


def run(parser: argparse.ArgumentParser, arguments: Sequence[str] | None = None) -> int:
    """Read a command line and call the function that the parser sets as `run`.

    Parameters
    ----------
    parser : ArgumentParser
        Parser of the command.
    arguments : sequence of str, optional
        Words of the command line; by default those of this process.

    Returns
    -------
    int
        Exit code: 0 if the function succeeded, 1 after a line that says why not.
    """
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(message)s", stream=sys.stderr)
    with reported() as failure:
        options.run(options)
    return failure.code


def _said(problem: str) -> int:
    print(f"handpipe: {' '.join(problem.split())}", file=sys.stderr)
    return 1
