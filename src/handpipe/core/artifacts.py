"""One way to write and read an artifact: HDF5 with units, schema version and provenance, atomic."""

from __future__ import annotations

import glob
import hashlib
import json
import os
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from handpipe import __version__
from handpipe.core.errors import InputError

SCHEMA_VERSION = 2  # of the files; another one is refused
REBUILD = "Delete the file and run the workflow again"
_STAGE: ContextVar[Mapping[str, str] | None] = ContextVar("_STAGE", default=None)


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; rename it to `path` only if the block succeeds.

    Temporary files of killed processes that wrote the same file are removed. After a power loss `path` is the
    old file or the new one, never a part of it.

    Parameters
    ----------
    path : path
        File to write; its folder is made if it is missing.

    Yields
    ------
    path
        Temporary path, which the block must write. It has the suffixes of `path`, by which many writers
        choose the format.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    for leftover in path.parent.glob(f".*.{glob.escape(path.name)}"):
        if leftover.name.removesuffix(f".{path.name}")[1:].isdigit():
            leftover.unlink(missing_ok=True)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        _to_disk(temporary)
        os.replace(temporary, path)
        _to_disk(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    if path.is_dir() and os.name != "posix":  # other systems open no folders
        return
    descriptor = os.open(path, os.O_RDONLY if os.name == "posix" else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def content_hash(path: str | Path) -> str:
    """SHA-256 in hexadecimal of a file, or of all files of a folder with their names."""
    state = Path(path).stat()
    return _content_hash(str(path), state.st_mtime_ns, state.st_size)


@cache
def _content_hash(path: str, _time: int, _size: int) -> str:
    if Path(path).is_dir():
        files = sorted(p for p in Path(path).rglob("*") if p.is_file())
        listing = "".join(f"{p.relative_to(path)} {content_hash(p)}\n" for p in files)
        return hashlib.sha256(listing.encode()).hexdigest()
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def identity(path: str | Path) -> str:
    """A hash of what results that are made of a file depend on.

    An artifact also records the commit of the code that wrote it, on which no result depends.

    Parameters
    ----------
    path : path
        A file or a folder.

    Returns
    -------
    str
        An artifact's hash of its data, else `content_hash`.
    """
    if Path(path).suffix == ".h5":
        with suppress(OSError):
            return str(read_attributes(path).get("data_hash") or content_hash(path))
    return content_hash(path)


def write(
    path: str | Path,
    data: Mapping[str, Any],
    *,
    kind: str,
    units: Mapping[str, str] | None = None,
    attributes: Mapping[str, Any] | None = None,
    inputs: Sequence[str | Path] = (),
) -> None:
    """Write nested mappings of arrays, numbers and strings as one artifact.

    The file is made in memory: HDF5 does not survive a full disk.

    Parameters
    ----------
    path : path
        File to write.
    data : mapping of str to array, number, str or mapping
        The content; a key may contain "/". `read` checks its hash.
    kind : str
        What the artifact is; `read` checks it.
    units : mapping of str to str, optional
        Units by the keys of `data`. A key names a dataset, or a group whose datasets share the unit.
    attributes : mapping of str to number or str, optional
        Further attributes of the file.
    inputs : sequence of path
        Files of which the artifact is made; their hashes are recorded.
    """
    # HDF5 needs a name for its messages; it writes no file of this name.
    with h5py.File(Path(path).name, "w", driver="core", backing_store=False, track_order=True) as file:
        file.attrs["kind"] = kind
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.attrs["handpipe_version"] = __version__
        file.attrs["path"] = _place(path)
        file.attrs["inputs"] = json.dumps({_place(p): identity(p) for p in inputs})
        for key, value in {**(_STAGE.get() or {}), **(attributes or {})}.items():
            file.attrs[key] = value
        _write_group(file, data)
        for key, unit in (units or {}).items():
            file[key].attrs["units"] = unit
        file.attrs["data_hash"] = _data_hash(_read_group(file))
        file.flush()
        image = file.id.get_file_image()
    with atomic(path) as temporary:
        temporary.write_bytes(image)


@contextmanager
def made_by(rule: str, parameters: Mapping[str, str]) -> Iterator[None]:
    """Artifacts written in the block record the rule, its parameters, and the commit of this code.

    Parameters
    ----------
    rule : str
        Name of the rule.
    parameters : mapping of str to str
        The rule's parameters by name.
    """
    stage = {"rule": rule, "parameters": json.dumps(parameters), "commit": commit()}
    token = _STAGE.set(stage)
    try:
        yield
    finally:
        _STAGE.reset(token)


@cache
def commit() -> str:
    """The commit of this code, "-dirty" added where files were changed; empty outside of a repository."""
    folder = Path(__file__).parent

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "--no-optional-locks", "-C", str(folder), *arguments],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", "artifacts.py")
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.CalledProcessError):
        return ""


def check_inputs(paths: Iterable[str | Path]) -> None:
    """Check the artifacts among a job's inputs against what they record of themselves and of each other.

    Parameters
    ----------
    paths : iterable of path
        The job's inputs; files other than artifacts are compared with what artifacts record of them.

    Raises
    ------
    InputError
        For an artifact that was written as another file, for one that cannot be read, and for an input that
        has changed since another input was made of it.
    """
    places = {_place(path): path for path in paths}
    for path in places.values():
        if Path(path).suffix == ".h5":
            recorded = _recorded(path)
            if recorded.get("path", _place(path)) != _place(path):
                problem = f"is the artifact {recorded['path']}, copied or renamed"
                raise InputError(path, "path", problem, REBUILD)
            for place, known in json.loads(recorded.get("inputs", "{}")).items():
                if place in places and identity(places[place]) != known:
                    problem = f"is not the file that {path} was made of"
                    raise InputError(places[place], "content", problem, f"Delete {path} and run again")


def _recorded(path: str | Path) -> dict[str, Any]:
    try:
        return read_attributes(path)
    except OSError as error:
        raise InputError(path, "content", f"cannot be read as HDF5 ({error})", REBUILD) from error


def _place(path: str | Path) -> str:
    """A path as artifacts record it: relative to the working folder, or the name of a file elsewhere."""
    path, here = Path(path).absolute(), Path.cwd()
    return path.relative_to(here).as_posix() if path.is_relative_to(here) else path.name


def _data_hash(data: Mapping[str, Any]) -> str:
    """Hash of all values as they are read, with their names, types and shapes."""
    digest = hashlib.blake2b(digest_size=16)
    for key, value in sorted(_leaves(data)):
        array = np.asarray(value)
        if array.dtype == object:
            array = np.array([str(text).encode() for text in array.ravel()], dtype=object)
            content = b"\0".join(array.tolist())
        else:
            content = np.ascontiguousarray(array).tobytes()
        digest.update(f"{key} {array.dtype.str} {np.shape(value)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def _leaves(data: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in data.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{before}{key}/")
        else:
            yield f"{before}{key}", value


def _write_group(group: h5py.Group, data: Mapping[str, Any]) -> None:
    for key, value in data.items():
        if isinstance(value, Mapping):
            inner = group[key] if key in group else group.create_group(key, track_order=True)
            _write_group(inner, value)
            continue
        array = np.asarray(value)
        if array.dtype.kind in "US":
            group.create_dataset(key, data=array.astype(object), dtype=h5py.string_dtype(), track_times=False)
        elif array.size > 1000:
            group.create_dataset(
                key, data=array, compression="gzip", compression_opts=1, shuffle=True, track_times=False
            )
        else:
            group.create_dataset(key, data=array, track_times=False)


def read(path: str | Path, kind: str, *, finite: bool = False) -> dict[str, Any]:
    """Read an artifact of the given kind.

    Parameters
    ----------
    path : path
        File to read.
    kind : str
        What the artifact must be, as `write` was told.
    finite : bool
        Whether NaN or infinity in any of its numbers is an error.

    Returns
    -------
    dict of str to array, number, str or dict
        The content.

    Raises
    ------
    InputError
        Where the file is missing, truncated or changed, of another kind or of another schema, or has a number
        that is not finite and must be.
    """
    if not Path(path).exists():
        raise InputError(path, "file", "does not exist", "Run the rule that makes it")
    try:
        with h5py.File(path, "r") as file:
            found, version = file.attrs.get("kind"), file.attrs.get("schema_version")
            if found != kind:
                raise InputError(
                    path, "kind", f"is {found!r}, not {kind!r}", "Give the artifact of the right stage"
                )
            if version != SCHEMA_VERSION:
                raise InputError(
                    path, "schema_version", f"is {version}, this handpipe reads {SCHEMA_VERSION}", REBUILD
                )
            data = _read_group(file)
            known = file.attrs.get("data_hash")
    except (OSError, RuntimeError, KeyError) as error:
        raise InputError(path, "content", f"cannot be read as HDF5 ({error})", REBUILD) from error
    if _data_hash(data) != known:
        raise InputError(path, "content", "is not what was written: its hash differs", REBUILD)
    if finite:
        _require_finite(path, data)
    return data


def _require_finite(path: str | Path, data: Mapping[str, Any]) -> None:
    for key, value in _leaves(data):
        array = np.asarray(value)
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            count = int((~np.isfinite(array)).sum())
            raise InputError(path, key, f"{count} of {array.size} numbers are NaN or infinite", REBUILD)


def _read_group(group: h5py.Group) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, item in group.items():
        if isinstance(item, h5py.Group):
            out[key] = _read_group(item)
        else:
            value = item.asstr()[()] if h5py.check_string_dtype(item.dtype) else item[()]
            out[key] = value
    return out


def read_attributes(path: str | Path) -> dict[str, Any]:
    """The artifact's own attributes: kind, versions, provenance and what its stage added."""
    with h5py.File(path, "r") as file:
        return dict(file.attrs)


def columns(records: Sequence[Any]) -> dict[str, list[Any]]:
    """Dataclass records of one type by columns, as an artifact holds them."""
    rows = [asdict(r) for r in records]
    return {key: [row[key] for row in rows] for key in rows[0]} if rows else {}


def read_text(path: str | Path) -> str:
    """Read a text file that a person wrote.

    Parameters
    ----------
    path : path
        File in UTF-8, with or without a byte order mark.

    Returns
    -------
    str

    Raises
    ------
    InputError
        Where the file is missing, cannot be read, or is not text.
    """
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(path, "file", "does not exist", "Check the path") from error
    except OSError as error:
        raise InputError(path, "file", f"cannot be read ({error.strerror})", "Check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(path, "file", f"is not text ({error})", "Save it in UTF-8") from error


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, atomically.

    Parameters
    ----------
    path : path
        File to write.
    text : str
        Its whole content.
    """
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
