"""A person's own label map: bones and muscles by name, on any grid in the frame of an image."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from handpipe.core import Array, InputError
from handpipe.core.artifacts import read_text
from handpipe.imaging.formats.segments import BACKGROUND, BACKGROUND_NAME, is_segmentation, segment_names
from handpipe.imaging.volumes.volume import Labels, Volume, read_label_table, stored_labels, table_path

LIMIT = 254  # the largest label of anything but the background
ALIKE = 0.6  # how alike a known name is that an error suggests, of 1
MARGIN = 3  # voxels around a mask: what smoothing needs
DESCRIPTION = re.compile(r'^\s*(\d+)\s+(?:[\d.]+\s+){6}"(.*)"\s*$')  # a line of ITK-SNAP's label descriptions


@dataclass(frozen=True)
class LabelMap:
    """Labels on a grid of their own.

    Parameters
    ----------
    source : Path
        The file.
    labels : array (nx, ny, nz) of uint8
        Label of each voxel, 0 for none.
    affine : array (4, 4)
        From voxel indices to world mm (RAS).
    numbers : mapping of str to int
        Label of each name, as the file or the table beside it spells it. A label without a name is
        named by its number.
    """

    source: Path
    labels: Labels
    affine: Array
    numbers: Mapping[str, int]

    def known(self, names: Iterable[str]) -> dict[str, int]:
        """Label of each of the names that the map holds, whatever the case of their letters."""
        own = {name.casefold(): label for name, label in self.numbers.items()}
        return {name: own[name.casefold()] for name in names if name.casefold() in own}

    def mask(self, label: int) -> Volume:
        """Which voxels have a label, as 1 and 0, in a box around them; they must not be none."""
        found = self.labels == label
        if not found.any():
            name = next(n for n, number in self.numbers.items() if number == label)
            problem = "is empty: no voxel has its label"
            raise InputError(self.source, name, problem, "Draw it, or remove its name from the file")
        spans = ndimage.find_objects(found.astype(np.uint8))[0]
        low, high = (np.array([getattr(s, end) for s in spans]) for end in ("start", "stop"))
        cut = Volume(found, self.affine).crop(low, high)
        padded = np.pad(cut.values.astype(np.float32), MARGIN)
        affine = cut.affine.copy()
        affine[:3, 3] = cut.to_world(np.full((1, 3), -MARGIN))[0]
        return Volume(padded, affine)


def read_label_map(path: str | Path, bones: Mapping[str, int]) -> LabelMap:
    """Read a person's label map.

    Parameters
    ----------
    path : str or Path
        A segmentation of 3D Slicer (.seg.nrrd), or a label volume of any format that volumes have. The names
        of a label volume are in the table beside it: the same name with .json ({name: label}), or ITK-SNAP's
        label descriptions with .txt or .label. Without a table its labels are those of `bones`.
    bones : mapping of str to int
        Label of each bone in the dataset.

    Returns
    -------
    LabelMap
        Labels on the map's own grid.

    Raises
    ------
    InputError
        As `read_labels` does, for segments that share voxels, and for a table that cannot be read.
    """
    path = Path(path)
    if is_segmentation(path) and path.exists():
        numbers = _numbered(segment_names(path))
        stored = stored_labels(path, numbers)
    else:
        stored = stored_labels(path)
        numbers = _numbers_of(path, stored.values, bones)
    labels = np.where(stored.values == BACKGROUND, np.uint8(0), stored.values)
    return LabelMap(path, labels, stored.affine, numbers)


def holds_background(path: Path) -> bool:
    """Whether a segmentation has strokes of the background, as seeds do and label maps do not.

    Parameters
    ----------
    path : Path
        A segmentation of 3D Slicer, or a label volume.

    Returns
    -------
    bool
        False, too, where the file cannot be read.
    """
    try:
        if is_segmentation(path):
            return BACKGROUND_NAME in map(str.casefold, segment_names(path))
        return bool((stored_labels(path).values == BACKGROUND).any())
    except InputError:
        return False  # the check of the subject's files says what is wrong


def labelled_names(path: str | Path, bones: Mapping[str, int], names: Collection[str]) -> list[str]:
    """The names that a label map holds.

    Of a segmentation of 3D Slicer the header alone is read.

    Parameters
    ----------
    path : str or Path
        As for `read_label_map`.
    bones : mapping of str to int
        Label of each bone in the dataset.
    names : collection of str
        All names that it may hold.

    Returns
    -------
    list of str
        As `names` spells them.

    Raises
    ------
    InputError
        For another name, and as `read_label_map` does.
    """
    path = Path(path)
    if is_segmentation(path) and path.exists():
        present = [*_numbered(segment_names(path))]
    else:
        present = [*read_label_map(path, bones).numbers]
    require_known(path, present, names)
    folded = {name.casefold() for name in present}
    return [name for name in names if name.casefold() in folded]


def require_known(source: str | Path, present: Collection[str], names: Collection[str]) -> None:
    """Check that a label map holds no other names than those of a dataset.

    Parameters
    ----------
    source : str or Path
        The label map, for messages.
    present : collection of str
        The names that it holds.
    names : collection of str
        Names of bones and muscles.

    Raises
    ------
    InputError
        For other names; it lists the names that are like them.
    """
    folded = {name.casefold(): name for name in names}
    unknown = [name for name in present if name.casefold() not in folded]
    if present and not unknown:
        return
    if not unknown:
        raise InputError(source, "names", "holds no bone or muscle", f"Name its labels {_listed(names)}")
    like = [f"{name!r}{_suggestion(name, folded)}" for name in unknown]
    problem = f"{', '.join(like)}: no bone or muscle of the dataset"
    raise InputError(source, "names", problem, f"The names are {_listed(names)}; rename or remove the others")


def _suggestion(name: str, folded: Mapping[str, str]) -> str:
    close = difflib.get_close_matches(name.casefold(), folded, n=2, cutoff=ALIKE)
    return f" (like {' or '.join(folded[c] for c in close)})" if close else ""


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)


def _numbered(names: Iterable[str]) -> dict[str, int]:
    """A label for each segment, but for the background."""
    named = [name for name in names if name.casefold() != BACKGROUND_NAME]
    return dict(zip(named, range(1, LIMIT + 1), strict=False))


def _numbers_of(path: Path, labels: Labels, bones: Mapping[str, int]) -> dict[str, int]:
    """Names of the labels in a label volume; those of a table that no voxel has are left out."""
    named = {label: name for name, label in _table(path, bones).items()}
    present = [int(label) for label in np.unique(labels) if label not in (0, BACKGROUND)]
    return {named.get(label, f"label {label}"): label for label in present}


def _table(path: Path, bones: Mapping[str, int]) -> Mapping[str, int]:
    """The names of labels: of the table beside a label volume, else the dataset's."""
    if table_path(path).is_file():
        return read_label_table(path)
    for suffix in (".txt", ".label"):
        beside = table_path(path).with_suffix(suffix)
        if beside.is_file():
            return _described(beside)
    return bones


def _described(path: Path) -> dict[str, int]:
    """Label by name of ITK-SNAP's label descriptions."""
    rows = [DESCRIPTION.match(line) for line in read_text(path).splitlines()]
    found = {row[2].strip(): int(row[1]) for row in rows if row}
    if not found:
        problem = "holds no line of a label, seven numbers and a name in quotes"
        raise InputError(path, "label descriptions", problem, "Export it from ITK-SNAP again, or remove it")
    return found
