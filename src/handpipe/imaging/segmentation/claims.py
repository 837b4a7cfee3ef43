"""What every bone claims of one pose's volume: found, written, read, and compared with what bones look like.

Strokes in the wrong place still give a region. Its appearance shows whether it is the intended bone: its
marrow is as bright as that of the bones around it, a dark shell encloses it, and it is as large as in
neutral.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import BoolArray, ConvergenceError, InputError, artifacts, write_text
from handpipe.imaging.segmentation.open_boundary import SHELL, open_patch
from handpipe.imaging.segmentation.segmentation import BoneProbability, SegmentationSettings, segment_bone
from handpipe.imaging.segmentation.unclaimed_marrow import NOTHING, Unclaimed, unclaimed_marrow
from handpipe.imaging.volumes.volume import Labels, Volume, box

logger = logging.getLogger(__name__)

Place = tuple[float, float, float]
KIND = "bone_probabilities"
NEIGHBOURS = 5  # bones around one whose marrow it is compared with
LEAST_LEVEL = 0.65  # of their marrow: muscle has half of it, a bias field changes little from bone to bone
LEAST_ENCLOSED = 0.6  # of the marrow's boundary that has a dark shell
DARK = 0.6  # of the marrow's level, in a voxel of a shell thinner than it
SAME = 0.2  # of its marrow's volume by which a rigid bone may differ between poses: noise, partial volume
BORDER = 1 / 3  # of a voxel by which its boundary may, where that is more: bones of few voxels
STAIRS = 2 / 3  # a ball's surface over that of its voxels
OPEN_FACES = 9  # of voxels: a patch of boundary without a shell; right bones of 0.8 mm have up to 3
UNDECIDED = 0.1  # of a bone's volume: a part that its strokes do not decide
LEAST_VOLUME = 8.0  # mm^3 of marrow: a small distal phalanx has 20
UNCLAIMED = 0.03  # of its volume that is left over within its shell
FEW_UNCLAIMED, MOST_UNCLAIMED = 10.0, 0.1  # mm^3: less counts only from this share on; it may be noise
BEYOND = 30.0  # mm around a bone in which its other part is looked for: half of a metacarpal
THIN = 4.0  # voxels across marrow: below, its Dice is 0.92 or less on generated bones, above 4.4 it is 0.94


def segment(
    volume: Volume, seeds: Labels, bones: Mapping[str, int], settings: SegmentationSettings
) -> tuple[dict[str, BoneProbability], dict[str, str]]:
    """The marrow of each bone from seeds, each bone by itself.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    seeds : array (nx, ny, nz) of uint8
        Strokes: 0 for none, labels of bones, 255 for the background.
    bones : mapping of str to int
        Label of each bone to segment.
    settings : SegmentationSettings
        Settings of the random walker and of its region.

    Returns
    -------
    found : dict of str to BoneProbability
        Marrow of the segmented bones.
    wrong : dict of str to str
        For each of the other bones what is wrong with its seeds, and what to draw.
    """
    found, wrong = {}, {}
    for number, (name, label) in enumerate(bones.items(), 1):
        logger.info("%s: %d of %d bones", name, number, len(bones))
        try:
            found[name] = segment_bone(volume, seeds, label, settings)
        except (InputError, ConvergenceError) as error:
            wrong[name] = _in_words(error)
            logger.warning("%s: %s", name, wrong[name])
    return found, wrong


def _in_words(error: InputError | ConvergenceError) -> str:
    """What is wrong with one bone's seeds, and what to draw."""
    if isinstance(error, InputError):
        return f"{error.problem}: {error.remedy[0].lower()}{error.remedy[1:]}"
    return str(error)


def save(path: str | Path, bones: Mapping[str, BoneProbability], inputs: Iterable[str | Path] = ()) -> None:
    """Write the probabilities of bones as an artifact.

    Parameters
    ----------
    path : str or Path
        File to write.
    bones : mapping of str to BoneProbability
        Probability of each bone's marrow by name.
    inputs : iterable of str or Path, optional
        Files that the probabilities were computed from; the artifact records their hashes.
    """
    data = {
        name: {
            "offset": b.offset,
            "probability": b.probability,
            "undecided": np.float64(b.undecided),
            "undecided_at": np.array(b.undecided_at),
            **({} if b.trust is None else {"trust": np.array(b.trust)}),
        }
        for name, b in bones.items()
    }
    units = {f"{name}/probability": "1" for name in bones} | {f"{name}/undecided": "mm^3" for name in bones}
    artifacts.write(path, data, kind=KIND, units=units, inputs=list(inputs))


def load(path: str | Path, corrected: Iterable[str | Path] = ()) -> dict[str, BoneProbability]:
    """Read the bones of an artifact, some of them replaced by corrected ones.

    Parameters
    ----------
    path : str or Path
        Artifact that `save` wrote.
    corrected : iterable of str or Path, optional
        Artifacts whose bones replace those of the same name.

    Returns
    -------
    dict of str to BoneProbability
        Probability of each bone's marrow by name.

    Raises
    ------
    InputError
        As `artifacts.read` does.
    """
    found: dict[str, BoneProbability] = {}
    for file in (path, *corrected):
        groups = artifacts.read(file, KIND)
        found |= {name: _bone(group) for name, group in groups.items()}
    return found


def _bone(group: Mapping[str, Any]) -> BoneProbability:
    x, y, z = group["undecided_at"].tolist()
    trust = tuple(group["trust"].tolist()) if "trust" in group else None
    return BoneProbability(group["offset"], group["probability"], float(group["undecided"]), (x, y, z), trust)


@dataclass(frozen=True)
class Appearance:
    """How the marrow that a bone claims looks in the image.

    Parameters
    ----------
    volume : float
        Volume of the marrow in mm^3.
    border : float
        Share of the volume that a layer of `BORDER` voxels at its boundary takes.
    level : float
        Median intensity.
    relative_level : float
        Median intensity over the median of the bones around it.
    enclosed : float
        Share of the boundary that has a dark shell.
    cut_off : bool
        Whether the marrow reaches the volume's border.
    spans : bool
        Whether the marrow reaches two opposite faces of the volume.
    open_area : float
        Area in mm^2 of the largest part of the boundary without a shell.
    open_at : tuple of 3 floats
        Middle of that part in world mm.
    open_limit : float
        Largest `open_area` in mm^2 that the voxels' steps explain.
    undecided : float
        Volume in mm^3 of the largest bright part that the strokes do not decide.
    undecided_at : tuple of 3 floats
        Middle of that part in world mm.
    unclaimed : float
        Volume in mm^3 of the largest bright part within the bone's shell that no bone claims.
    unclaimed_at : tuple of 3 floats
        Middle of that part in world mm.
    width : float
        Mean width of the marrow in voxels: that of a cylinder of its volume and surface.
    """

    volume: float
    border: float
    level: float
    relative_level: float
    enclosed: float
    cut_off: bool
    spans: bool = False
    open_area: float = 0.0
    open_at: Place = (0.0, 0.0, 0.0)
    open_limit: float = 1.0
    undecided: float = 0.0
    undecided_at: Place = (0.0, 0.0, 0.0)
    unclaimed: float = 0.0
    unclaimed_at: Place = (0.0, 0.0, 0.0)
    width: float = float("inf")

    @property
    def thin(self) -> bool:
        """Whether the marrow has too few voxels across for a right surface."""
        return self.width < THIN

    def doubts(self, neutral: Appearance | None = None) -> list[str]:
        """Doubts about a bone, in words.

        Parameters
        ----------
        neutral : Appearance, optional
            How the bone looks in neutral, if known.

        Returns
        -------
        list of str
            Doubts with what to draw; empty if there are none.
        """
        doubts = []
        if self.relative_level < LEAST_LEVEL:
            doubts.append(
                f"it is only {self.relative_level:.2f} times as bright as the bones around it: "
                "draw its strokes in its marrow"
            )
        if self.enclosed < LEAST_ENCLOSED:
            doubts.append(
                f"a dark shell encloses only {100 * self.enclosed:.0f} % of it: "
                "draw strokes of the background where it leaves its shell"
            )
        if neutral is not None and not (self.cut_off or neutral.cut_off):
            change = self.volume / max(neutral.volume, 1e-12) - 1
            if abs(change) > max(SAME, neutral.border):
                doubts.append(f"its marrow's volume differs by {100 * change:+.0f} % from neutral")
        return doubts if neutral is not None else doubts + self._ends()

    def _ends(self) -> list[str]:
        """What speaks against its ends, where no other pose tells its size; with what to draw."""
        doubts = []
        if self.volume < LEAST_VOLUME:
            doubts.append(f"its marrow has only {self.volume:.1f} mm^3: draw strokes along its whole marrow")
        if self.spans:
            doubts.append(
                "it reaches from one face of the volume to the opposite one: "
                "draw strokes of the background around it"
            )
        if self.open_area > self.open_limit:
            doubts.append(
                f"no dark shell closes {self.open_area:.0f} mm^2 of it about {_words(self.open_at)}: draw a "
                "stroke of its label there if its marrow goes on, else one of the background"
            )
        if self.unclaimed > min(max(UNCLAIMED * self.volume, FEW_UNCLAIMED), MOST_UNCLAIMED * self.volume):
            doubts.append(
                f"{self.unclaimed:.0f} mm^3 about {_words(self.unclaimed_at)} look like marrow in the same "
                "shell: draw a stroke of its label there"
            )
        return doubts


def _words(place: Place) -> str:
    x, y, z = place
    return f"({x:.1f}, {y:.1f}, {z:.1f}) mm"


def appearances(volume: Volume, bones: Mapping[str, BoneProbability]) -> dict[str, Appearance]:
    """How every bone looks; a bone that claims nothing has no volume and no shell."""
    levels, places = {}, {}
    for name, bone in bones.items():
        claimed = bone.probability > 0.5
        values = volume.values[bone.slices][claimed]
        levels[name] = float(np.median(values)) if len(values) else 0.0
        index = np.argwhere(claimed if len(values) else np.ones_like(claimed))
        middle = bone.offset + index.mean(0)
        places[name] = volume.to_world(middle[None])[0]
    left = {name: _left_over(volume, bones, name, levels[name]) for name in bones}
    return {name: _appearance(volume, bone, name, levels, places, left[name]) for name, bone in bones.items()}


def _appearance(
    volume: Volume,
    bone: BoneProbability,
    name: str,
    levels: Mapping[str, float],
    places: Mapping[str, NDArray],
    left: Unclaimed,
) -> Appearance:
    claimed = bone.probability > 0.5
    voxel = float(np.prod(volume.spacing))
    values = volume.values[bone.slices] / max(levels[name], 1e-12)
    patch = open_patch(values, claimed, volume.spacing)
    others = sorted((n for n in levels if n != name), key=lambda n: np.linalg.norm(places[n] - places[name]))
    around = float(np.median([levels[n] for n in others[:NEIGHBOURS] or [name]]))
    return Appearance(
        **extent(volume, bone),
        level=levels[name],
        relative_level=levels[name] / max(around, 1e-12),
        enclosed=_enclosed(volume, bone, claimed, levels[name]),
        open_area=patch.area,
        open_at=_place(volume, patch.middle + bone.offset),
        open_limit=OPEN_FACES * voxel ** (2 / 3),
        undecided=bone.undecided,
        undecided_at=_place(volume, np.array(bone.undecided_at)),
        unclaimed=left.volume,
        unclaimed_at=_place(volume, left.middle),
    )


def extent(volume: Volume, bone: BoneProbability) -> dict[str, Any]:
    """How large a bone is and whether the volume's border cuts it: fields of `Appearance`."""
    claimed = bone.probability > 0.5
    return {
        "volume": float(claimed.sum()) * float(np.prod(volume.spacing)),
        "border": _border(claimed),
        "width": _width(bone.probability),
        "cut_off": _cut_off(bone, claimed, volume.shape),
        "spans": _spans(bone, claimed, volume.shape),
    }


def _left_over(volume: Volume, bones: Mapping[str, BoneProbability], name: str, level: float) -> Unclaimed:
    """Marrow within `BEYOND` of a bone that it lacks; its middle in voxels of the whole volume."""
    claimed = np.argwhere(bones[name].probability > 0.5) + bones[name].offset
    if len(claimed) == 0:
        return NOTHING
    reach = np.ceil(BEYOND / volume.spacing).astype(np.int64)
    lower = np.maximum(claimed.min(axis=0) - reach, 0)
    upper = np.minimum(claimed.max(axis=0) + 1 + reach, volume.shape)
    own, others = np.zeros((2, *(upper - lower)), bool)
    for other, bone in bones.items():
        first, last = np.maximum(lower, bone.offset), np.minimum(upper, bone.offset + bone.probability.shape)
        if (first < last).all():
            part = bone.probability[box(first - bone.offset, last - bone.offset)] > 0.5
            (own if other == name else others)[box(first - lower, last - lower)] |= part
    left = unclaimed_marrow(volume.values[box(lower, upper)] / max(level, 1e-12), own, others, volume.spacing)
    return Unclaimed(left.volume, left.middle + lower)


def _border(claimed: BoolArray) -> float:
    """Share of the claimed voxels that a layer of `BORDER` voxels at their boundary amounts to."""
    padded = np.pad(claimed, 1)
    faces = sum(np.count_nonzero(np.diff(padded, axis=axis)) for axis in range(3))
    return BORDER * STAIRS * float(faces) / max(int(np.count_nonzero(claimed)), 1)


def _width(probability: NDArray[np.floating]) -> float:
    """Width in voxels of a cylinder that has the volume and the lateral surface of a region."""
    padded = np.pad(probability, 1)
    surface = float(np.sqrt(sum(g**2 for g in np.gradient(padded))).sum())
    return 4 * float(padded.sum()) / max(surface, 1e-12)


def _enclosed(volume: Volume, bone: BoneProbability, claimed: BoolArray, level: float) -> float:
    """Share of the claimed voxels beside unclaimed ones that have a dark voxel within `SHELL`.

    The volume's border is no boundary: whatever the bone has beyond it is not seen.
    """
    outside = ~np.pad(claimed, 1, mode="edge")
    beside = ndimage.binary_dilation(outside)[1:-1, 1:-1, 1:-1] & claimed
    dark = volume.values[bone.slices] < DARK * level
    if not beside.any() or not dark.any():
        return 0.0
    distance = ndimage.distance_transform_edt(~dark, sampling=volume.spacing)
    return float((distance[beside] < SHELL + 0.5 * volume.spacing.max()).mean())


def _cut_off(bone: BoneProbability, claimed: BoolArray, shape: tuple[int, int, int]) -> bool:
    """Whether claimed voxels lie on a face of the whole volume."""
    index = np.argwhere(claimed) + bone.offset
    return bool(((index == 0) | (index == np.array(shape) - 1)).any())


def _spans(bone: BoneProbability, claimed: BoolArray, shape: tuple[int, int, int]) -> bool:
    """Whether claimed voxels lie on two opposite faces of the whole volume."""
    index = np.argwhere(claimed) + bone.offset
    return bool(((index == 0).any(axis=0) & (index == np.array(shape) - 1).any(axis=0)).any())


def _place(volume: Volume, index: NDArray) -> Place:
    x, y, z = volume.to_world(index[None])[0].tolist()
    return x, y, z


def doubted(
    looks: Mapping[str, Appearance], neutral: Mapping[str, Appearance], corrected: Collection[str] = ()
) -> dict[str, str]:
    """The bones that do not look as they should, with the reasons.

    Each doubt is logged.

    Parameters
    ----------
    looks : mapping of str to Appearance
        Appearance of each bone in the pose.
    neutral : mapping of str to Appearance
        Appearance of bones in neutral, where it is known.
    corrected : collection of str, optional
        Bones whose appearance a person has accepted by scribbles: their doubts are only logged.

    Returns
    -------
    dict of str to str
        Doubts by bone.
    """
    wrong = {}
    for name, look in looks.items():
        if look.cut_off:
            logger.warning("%s: cut off by the volume's border; its surface is closed there", name)
        if name not in neutral and look.thin:
            logger.warning(
                "%s: its marrow is %.1f voxels across: its surface is uncertain; take smaller voxels",
                name,
                look.width,
            )
        if name not in neutral and look.undecided > UNDECIDED * look.volume:
            logger.warning(
                "%s: its strokes leave %.0f mm^3 about %s undecided; draw there if its surface is wrong",
                name,
                look.undecided,
                _words(look.undecided_at),
            )
        if doubts := look.doubts(neutral.get(name)):
            logger.warning("%s: doubted, since %s", name, " and ".join(doubts))
            if name not in corrected:
                wrong[name] = " and ".join(doubts)
    return wrong


def write_looks(path: str | Path, looks: Mapping[str, Appearance], left_out: Mapping[str, str]) -> None:
    """Write how the bones of a pose look, and why bones are left out, as JSON."""
    data = {"bones": {name: asdict(look) for name, look in looks.items()}, "left_out": dict(left_out)}
    write_text(path, json.dumps(data, indent=2) + "\n")


def read_looks(path: str | Path) -> tuple[dict[str, Appearance], dict[str, str]]:
    """How the bones of a pose look, and why bones are left out.

    Parameters
    ----------
    path : str or Path
        JSON file that `write_looks` wrote.

    Returns
    -------
    looks : dict of str to Appearance
        Appearance of each bone by name.
    left_out : dict of str to str
        Why each of the other bones is left out.
    """
    data = json.loads(Path(path).read_text(encoding="utf-8"))
    places = ("open_at", "undecided_at", "unclaimed_at")
    for fields in data["bones"].values():
        fields |= {key: tuple(fields[key]) for key in places if key in fields}
    return {name: Appearance(**fields) for name, fields in data["bones"].items()}, data["left_out"]
