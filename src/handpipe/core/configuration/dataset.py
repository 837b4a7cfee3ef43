"""Everything that a subject has, and its file."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from handpipe.core.configuration.anatomy import Bone, Joint, Muscle, Nail, Tendon
from handpipe.core.configuration.images import Images, Limb, Scanner
from handpipe.core.configuration.loading import checked, read_yaml
from handpipe.core.configuration.model import Model, Name, Subject
from handpipe.core.configuration.pose import Pose, Role
from handpipe.core.configuration.tree_order import joint_order
from handpipe.core.errors import InputError

Interpolation = Literal["inverse-distance", "inverse-square", "rbf"]


class Segmentation(Model):
    """How bones are told from other tissue where they are not a hand's."""

    marks: Literal["intensity", "distance"] = Field(
        default="intensity",
        description="what tells the voxels that need no random walker: how far the intensity departs on the "
        "way to a stroke, or how long the way is: for limbs, whose fat is as bright as marrow",
    )
    level: Literal["local", "even"] = Field(
        default="local",
        description="of marrow where bones are looked for: that of the brightest tissue nearby, or one "
        "for the whole image, for images without shading whose fat outshines the marrow",
    )
    edges: float = Field(
        default=0.8,
        gt=0,
        le=1,
        description="share of a bone's surface with an edge in a right place: less where cartilage hides it",
    )
    around: float = Field(
        default=2.4,
        gt=0,
        le=6,
        description="mm from a bone that was looked for, beyond which proposed seeds are background",
    )
    neck: float = Field(
        default=0.0, ge=0, description="what hangs on the strokes by less than this thickness is cut off, mm"
    )


class Truth(Model):
    """Known truth of a phantom in each pose: `folder`/{pose}.h5 and label volumes beside it."""

    folder: Path


class Dataset(Model):
    """Everything that a subject has."""

    name: Subject
    like: Subject | None = Field(
        None, description="another dataset beside this file, whose keys hold where this file has none"
    )
    generator: str | None = Field(
        None, description="what makes the subject's files; none where they are given. See config/README.md"
    )
    seed: int = Field(0, ge=0)
    proportions: str | None = Field(
        None, description="generated hands with all organs: the measured person whose proportions they have"
    )
    scanner: Scanner | None = Field(
        None, description="generated whole hands: voxel size, bias field and noise"
    )
    images: Images | None = Field(
        None, description="generated subjects: image model, sequence, field and effects"
    )
    limb: Limb | None = Field(
        None, description="of a subject of real images: its images, their unit, its strokes"
    )
    segmentation: Segmentation | None = Field(None, description="of bones that are not a hand's")
    anatomy: Path | None = Field(None, description="folder of the source anatomy of a generated subject")
    root: Path
    units: Literal["mm"] = "mm"
    licence: str | None = Field(None, description="of the subject's data, which its training sets state")
    hand: Literal["right", "left"] = "right"
    poses: dict[Name, Pose]
    bones: dict[Name, Bone]
    other_labels: dict[Name, int] = Field(
        {}, description="labels of other bones in the seeds: known not to be any of `bones`, and not modelled"
    )
    contrast: Literal["bright_marrow", "learned"] = Field(
        "bright_marrow",
        description="how bones show: as bright marrow within a dark shell, or as their strokes teach",
    )
    registration: Literal["surfaces", "images"] = Field(
        "images",
        description="what tells a bone's motion: its surfaces alone, or these and then, where they leave its "
        "turn open, the images in the bone's own region",
    )
    joints: dict[Name, Joint]
    muscles: dict[Name, Muscle] = {}
    ligaments: dict[Name, Muscle] = {}
    tendons: dict[Name, Tendon] = {}
    nails: dict[Name, Nail] = {}
    muscle_interpolation: Interpolation = Field(
        "rbf",
        description="of muscle strains over poses: rbf follows trends, the others stay within the examples",
    )
    drawn_in: Literal["neutral", "template"] = Field(
        "neutral",
        description="frame of axis hints, tendons' paths and nails: that of the neutral image, or of the "
        "bones' templates, which carry them onto the subject's bones",
    )
    skin_from_volume: bool | None = Field(
        None,
        description="whether the volume of a pose without `scan` gives its skin: true, to all layers; false, "
        "to none; by default to fat and skin of scanned subjects, and to none of generated ones",
    )
    regions: dict[Literal["bone_fascia", "muscle_fascia"], Path] = Field(
        {},
        description='painted regions of a fascia: JSON list of "contact", "sliding" or "fixed", one a vertex',
    )
    truth: Truth | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Dataset:
        if [p.role for p in self.poses.values()].count(Role.neutral) != 1:
            raise ValueError("poses: exactly one pose has the role neutral")
        rest = self.poses[self.neutral]
        if rest.seeds is None and rest.labels is None:
            raise ValueError(f"poses.{self.neutral}: the neutral pose needs seeds, or labels of its bones")
        unmarked = [name for name, pose in self.poses.items() if pose.seeds is None]
        if self.contrast == "learned" and unmarked:
            raise ValueError(f"poses.{unmarked[0]}: needs seeds, since contrast is learned from them")
        labelled = [name for name, pose in self.poses.items() if pose.labels is not None]
        if self.contrast == "learned" and labelled:
            raise ValueError(f"poses.{labelled[0]}.labels: contrast is learned from seeds: give these alone")
        if self.images is not None and self.generator is None:
            raise ValueError("images: is only for generated subjects; a scanned one names its volumes")
        if self.limb is not None and set(self.limb.volumes) != set(self.poses):
            raise ValueError("limb: volumes: needs the file of each pose, and of no other")
        for kind, named in (
            *((f"poses.{k}.scribbles", tuple(p.scribbles)) for k, p in self.poses.items()),
            *((f"joints.{k}", (j.parent, j.child)) for k, j in self.joints.items()),
            *((f"tendons.{k}", t.bones) for k, t in self.tendons.items()),
            *((f"nails.{k}", (n.bone,)) for k, n in self.nails.items()),
        ):
            for bone in named:
                if bone not in self.bones:
                    raise ValueError(f"{kind}: names the bone {bone!r}, which is not under bones")
        bare = [name for name, bone in self.bones.items() if bone.template is None]
        if self.drawn_in == "template" and bare:
            raise ValueError(f"drawn_in: template needs bones.{bare[0]}.template, and those of all bones")
        unique: dict[str, list[Any]] = {
            "bones: the label": [*(bone.label for bone in self.bones.values()), *self.other_labels.values()],
            "joints: the angle": [angle for joint in self.joints.values() for angle in joint.angles],
        }
        for kind, values in unique.items():
            twice = [value for value in values if values.count(value) > 1]
            if twice:
                raise ValueError(f"{kind} {twice[0]!r} stands twice")
        for bone, label in self.other_labels.items():
            if bone in self.bones:
                raise ValueError(f"other_labels: {bone!r} is under bones, too")
            if not 1 <= label <= 254:
                raise ValueError(f"other_labels: {label} of {bone} is no label: 1 to 254 are")
        children = [j.child for j in self.joints.values()]
        if len(set(children)) != len(children) or len(self.root_bones) != 1:
            raise ValueError("joints: must form one tree over the bones, each bone a child at most once")
        try:
            joint_order({name: (joint.parent, joint.child) for name, joint in self.joints.items()})
        except ValueError as error:
            raise ValueError(f"joints: {error}") from error
        return self

    # What follows from fields; a stage may read it alone, without them
    # (`handpipe.core.configuration.selection`).
    @cached_property
    def root_bones(self) -> list[str]:
        """Bones that are no joint's child, in file order; a valid dataset has exactly one."""
        children = {j.child for j in self.joints.values()}
        return [b for b in self.bones if b not in children]

    @cached_property
    def root_bone(self) -> str:
        """The bone at the root of the joint tree."""
        return self.root_bones[0]

    @cached_property
    def neutral(self) -> str:
        """Name of the neutral pose."""
        return next(n for n, p in self.poses.items() if p.role is Role.neutral)

    @property
    def labels(self) -> dict[str, int]:
        """Label of each bone in seed and label volumes."""
        return {name: bone.label for name, bone in self.bones.items()}

    @property
    def seed_labels(self) -> dict[str, int]:
        """Label of each bone that seeds may hold."""
        return self.labels | self.other_labels

    def poses_of(self, *roles: Role) -> list[str]:
        """Names of the poses with one of the roles, in file order."""
        return [n for n, p in self.poses.items() if p.role in roles]

    @cached_property
    def examples(self) -> list[str]:
        """Names of the example poses, in file order."""
        return self.poses_of(Role.example)

    @cached_property
    def heldout(self) -> list[str]:
        """Names of the held-out poses, in file order."""
        return self.poses_of(Role.heldout)

    @cached_property
    def fleshed(self) -> bool:
        """Whether one soft tissue between bones and skin can be made, which carries tendons and muscles."""
        return self.poses[self.neutral].scan is not None or self.skin_from_volume is True

    def has_skin(self, pose: str) -> bool:
        """Whether a pose has a skin: a scan, or a volume that gives it."""
        given = self.generator is None if self.skin_from_volume is None else self.skin_from_volume
        return self.poses[pose].scan is not None or given

    def path(self, relative: Path) -> Path:
        """A path of this dataset, resolved."""
        return self.root / relative


def load_dataset(path: str | Path) -> Dataset:
    """Read a dataset file, completed by the one that it is `like`.

    Parameters
    ----------
    path : path
        YAML file of the dataset.

    Returns
    -------
    Dataset

    Raises
    ------
    InputError
        As `load_yaml`; where `like` names no dataset beside it, or one that is itself like another; and where
        a generator would write outside the subject's own folder of results.
    """
    dataset = _dataset(path)
    if dataset.generator is not None:
        _require_own_folder(path, dataset)
    return dataset


def _require_own_folder(path: str | Path, dataset: Dataset) -> None:
    """Refuse a generator that would write outside the subject's own folder of results."""
    own, root = Path("results") / Path(path).stem, dataset.root.resolve()
    if not root.is_relative_to(own.resolve()):
        problem = f"is {dataset.root}, but what is generated stays under {own}"
        raise InputError(path, "root", problem, f"Write {own}/data")
    inside: dict[Path, bool] = {}  # hundreds of files lie in a few folders
    written = dataset.model_dump(exclude={"root", "anatomy", "limb"}, exclude_none=True)
    for field, relative in _paths(written):
        target = dataset.path(relative)
        own_way = relative.name in ("", "..") or target.is_symlink()  # its parent does not tell where it is
        place = target if own_way else target.parent
        if place not in inside:
            inside[place] = place.resolve().is_relative_to(root)
        if not inside[place]:
            problem = f"is {relative}, which leads out of {dataset.root}"
            raise InputError(path, field, problem, "Give a path inside of root")


def _paths(content: Any, field: str = "") -> Iterator[tuple[str, Path]]:
    """Every path in nested mappings, with its field, e.g. "poses.fist.volume"."""
    if isinstance(content, Path):
        yield field, content
    elif isinstance(content, dict):
        for key, value in content.items():
            yield from _paths(value, f"{field}.{key}" if field else str(key))
    elif isinstance(content, tuple):
        for number, value in enumerate(content):
            yield from _paths(value, f"{field}.{number}")


def _dataset(path: str | Path) -> Dataset:
    content = read_yaml(path)
    if not isinstance(content, dict) or "like" not in content:
        return checked(path, content, Dataset)
    other = Path(path).with_name(f"{content['like']}.yaml")
    if not other.is_file():
        raise InputError(path, "like", f"there is no {other.name} beside it", "Name a dataset of that folder")
    further = read_yaml(other)
    if "like" in further:
        raise InputError(path, "like", f"{other.name} is like another one itself", "Name that one")
    return checked(path, {**further, **content}, Dataset)
