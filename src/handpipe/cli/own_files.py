"""A folder that a command writes to again: files of its earlier run go, nobody else's are touched."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from handpipe.core import InputError, read_text, write_text
from handpipe.core.artifacts import content_hash

LISTED = "handpipe-files.json"  # hash of each file by who wrote it, beside the files


@contextmanager
def written_anew(folder: Path, owner: str) -> Iterator[Path]:
    """Give an empty folder, whose files come to `folder` if the block succeeds; the owner's earlier ones go.

    A file that was changed since the owner wrote it, and one that nobody listed, remains unless the block
    writes one of its name.

    Parameters
    ----------
    folder : path
        Made if it is not there.
    owner : str
        Command, with its subject if it has one.

    Yields
    ------
    path
        Folder for the block to write to.

    Raises
    ------
    InputError
        If the list of files is damaged, or a file of another owner would be replaced.
    """
    listed = _read(folder / LISTED)
    folder.parent.mkdir(parents=True, exist_ok=True)
    inside = folder if folder.is_dir() else folder.parent
    with tempfile.TemporaryDirectory(dir=inside, prefix=f".{folder.name}-") as temporary:
        made = Path(temporary)
        yield made
        names = [str(p.relative_to(made)) for p in sorted(made.rglob("*")) if p.is_file()]
        others = {name: other for other, files in listed.items() for name in files if other != owner}
        for name in (n for n in names if n in others):
            problem = f"was written by {others[name]}, and {owner} writes a file of this name"
            raise InputError(folder / name, "file", problem, "Name another folder")
        before, new = listed.get(owner, {}), {name: content_hash(made / name) for name in names}
        folder.mkdir(exist_ok=True)
        _write(folder / LISTED, listed | {owner: before | new})  # of a killed run, nothing is forgotten
        for name in names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (made / name).replace(folder / name)
        for name in before.keys() - new.keys():
            _remove(folder, name, before[name])
        _write(folder / LISTED, listed | {owner: new})


def _remove(folder: Path, name: str, known: str) -> None:
    """Remove a file that is as it was written, and the folders that it leaves empty."""
    path = folder / name
    if not path.is_file() or content_hash(path) != known:
        return
    path.unlink()
    for above in path.relative_to(folder).parents:
        if above != Path() and not any((folder / above).iterdir()):
            (folder / above).rmdir()


def _read(path: Path) -> dict[str, dict[str, str]]:
    """Hash of each file by owner and name."""
    if not path.is_file():
        return {}
    try:
        found = json.loads(read_text(path))
        return {
            str(owner): {_inside(name): str(known) for name, known in files.items()}
            for owner, files in found.items()
        }
    except (ValueError, AttributeError) as error:
        raise InputError(path, "content", f"is no list of files ({error})", "Name another folder") from error


def _inside(name: str) -> str:
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise ValueError(f"{name} leads out of the folder")
    return name


def _write(path: Path, listed: dict[str, dict[str, str]]) -> None:
    write_text(path, json.dumps(listed, indent=1) + "\n")
