"""One way to write and read an artifact: HDF5 with units, schema version and provenance, atomic."""

from __future__ import annotations

import glob
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from handpipe import __version__
from handpipe.errors import InputError

SCHEMA_VERSION = 1


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; rename it to `path` only if the block succeeds.

    The temporary name keeps the suffixes of `path`, which many writers go by. What a killed process left
    of the same file is removed.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    for leftover in path.parent.glob(f".*.{glob.escape(path.name)}"):
        if leftover.name.removesuffix(f".{path.name}")[1:].isdigit():
            leftover.unlink(missing_ok=True)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def content_hash(path: str | Path) -> str:
    """SHA-256 in hexadecimal of a file, or of all files of a folder with their names."""
    if Path(path).is_dir():
        files = sorted(p for p in Path(path).rglob("*") if p.is_file())
        listing = "".join(f"{p.relative_to(path)} {content_hash(p)}\n" for p in files)
        return hashlib.sha256(listing.encode()).hexdigest()
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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

    `data` keys may contain "/"; `units` gives the unit by the same keys (a key names a dataset or a
    group whose datasets share it); `kind` names what the artifact is and is checked by `read`. The file
    is made in memory: HDF5 does not survive a full disk.
    """
    # A name for messages alone: nothing of this name is written.
    with h5py.File(Path(path).name, "w", driver="core", backing_store=False, track_order=True) as file:
        file.attrs["kind"] = kind
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.attrs["handpipe_version"] = __version__
        file.attrs["inputs"] = json.dumps({str(p): content_hash(p) for p in inputs})
        for key, value in (attributes or {}).items():
            file.attrs[key] = value
        _write_group(file, data)
        for key, unit in (units or {}).items():
            file[key].attrs["units"] = unit
        file.flush()
        image = file.id.get_file_image()
    with atomic(path) as temporary:
        temporary.write_bytes(image)


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


def read(path: str | Path, kind: str) -> dict[str, Any]:
    """Read an artifact of the given kind as nested dictionaries of arrays, numbers and strings.

    Raises `InputError` where the file is missing, truncated, of another kind or of another schema.
    """
    rebuild = "Delete the file and run the workflow again"
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
                    path, "schema_version", f"is {version}, this handpipe reads {SCHEMA_VERSION}", rebuild
                )
            return _read_group(file)
    except (OSError, RuntimeError, KeyError) as error:
        raise InputError(path, "content", f"cannot be read as HDF5 ({error})", rebuild) from error


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
    """Read a person's text file in UTF-8; raises `InputError` where it is missing or no text."""
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(path, "file", "does not exist", "Check the path") from error
    except OSError as error:
        raise InputError(path, "file", f"cannot be read ({error.strerror})", "Check the path") from error
    except UnicodeDecodeError as error:
        raise InputError(path, "file", f"is not text ({error})", "Save it in UTF-8") from error


def write_text(path: str | Path, text: str) -> None:
    """Write a text file atomically."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
