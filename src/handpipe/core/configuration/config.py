"""Typed descriptions of what a person decides: a dataset, a scene, and the settings of each stage."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import yaml
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from handpipe.core.artifacts import read_text
from handpipe.core.configuration.tree_order import joint_order
from handpipe.core.errors import InputError
from handpipe.core.layer_registry import needed, organs

T = TypeVar("T", bound=BaseModel)
Vector = tuple[float, float, float]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
Subject = Annotated[str, Field(pattern=r"^[a-z][a-z0-9-]*$")]
Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]  # mm
Fidelity = Literal["preview", "standard", "paper"]
Interpolation = Literal["inverse-distance", "inverse-square", "rbf"]
Strength = Literal["none", "usual", "severe"]
ImageEffect = Literal[
    "coil",
    "noise",
    "chemical_shift",
    "gibbs",
    "partial_fourier",
    "ghosts",
    "slice_profile",
    "slice_thickness",
    "wrap",
    "distortion",
    "vessels_void",
    "vessels_bright",
    "nerves",
    "muscle_streaks",
    "joints",
    "skin",
    "septa",
    "palmar_fascia",
    "trabeculae",
]


class UndeclaredFieldError(Exception):
    """A stage reads a field that its rule does not declare, and whose change would not rerun it."""


class Model(BaseModel):
    """Base of all configuration models: immutable, without unknown fields or numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Called for missing attributes alone: a selection (`selection.select`) lacks fields."""
            if name in type(self).model_fields:
                kind = type(self).__name__
                raise UndeclaredFieldError(f"{kind}.{name} is not declared by the rule of this script")
            return super().__getattr__(name)


class Role(StrEnum):
    """What a pose is for: the neutral pose, an example to fit to, or a pose held out for evaluation."""

    neutral = "neutral"
    example = "example"
    heldout = "heldout"


class Echo(Model):
    """One gradient echo of a Dixon acquisition."""

    time_ms: float = Field(gt=0, lt=100, description="echo time in ms")
    magnitude: Path = Field(description="magnitude, on the grid of `volume`; any format of `volume`")
    phase: Path | None = Field(
        None, description="phase in radians, degrees or the scanner's whole numbers; needed"
    )


class Dixon(Model):
    """Gradient echoes of one pose from which fat and water are separated."""

    echoes: tuple[Echo, ...] = Field(min_length=2, description="in the order of their times")
    field_T: float = Field(ge=0.2, le=12, description="field strength of the scanner in T")

    @model_validator(mode="after")
    def _separable(self) -> Dixon:
        times = [echo.time_ms for echo in self.echoes]
        if any(later <= earlier for earlier, later in zip(times, times[1:], strict=False)):
            raise ValueError("echoes: time_ms has to increase from echo to echo")
        if any(echo.phase is None for echo in self.echoes):
            raise ValueError(
                "echoes: without phase nobody can tell fat from water: a voxel of fat is as bright as one of "
                "water; give the phase of every echo"
            )
        return self


class Pose(Model):
    """What was acquired in one pose. Paths are relative to the dataset's root."""

    role: Role
    volume: Path = Field(description="MRI volume: NIfTI, NRRD, MetaImage, or a folder of DICOM images")
    series: int | str | None = Field(
        None, description="of a folder with several DICOM series: its number, description or UID"
    )
    echo: int | None = Field(
        None, ge=1, description="of a DICOM series with several echoes: 1 is the one of the shortest time"
    )
    channels: dict[Name, Path] = Field(
        {}, description="further volumes of the same pose on the grid of `volume`, by name, e.g. fat"
    )
    dixon: Dixon | None = Field(
        None, description="gradient echoes with phase: fat and water are separated from them"
    )
    seeds: Path | None = Field(
        None,
        description="seeds: label volume on the grid of `volume`, 0 none, bone labels, 255 background; or a "
        "segmentation (.seg.nrrd) with segments named as the bones are, and `background`",
    )
    labels: Path | None = Field(
        None,
        description="a person's own label map in the frame of `volume`: its bones are not segmented, its "
        "muscles are fitted to it; .seg.nrrd by the segments' names, or a label volume",
    )
    labels_show: Literal["whole", "marrow"] = Field(
        "whole", description="what `labels` show of a bone: all of it with its cortex, or its marrow"
    )
    scan: Path | None = Field(
        None,
        description="skin scan: PLY, OBJ or STL in mm, in the frame that `scan_frame` tells; may have holes",
    )
    scan_frame: Literal["volume", "own"] = Field(
        "volume",
        description="frame of the scan: that of `volume`, or its own; from that it is aligned to the skin in "
        "`volume`",
    )
    scribbles: dict[Name, Path] = Field({}, description="extra seeds for one bone, same format as `seeds`")
    markers: dict[Name, Path] = Field(
        {}, description="hand-placed boundary markers of a muscle: 3D Slicer .mrk.json"
    )
    landmarks: dict[Name, Path] = Field(
        {}, description="landmarks of a muscle: .mrk.json, labels as in the template's"
    )


class Bone(Model):
    """A bone's label in volumes and, where muscle templates are placed, its template surface."""

    label: int = Field(ge=1, le=254, description="its value in seed and label volumes")
    template: Path | None = Field(
        None, description="surface of the same bone in the frame of the muscle templates"
    )


class Joint(Model):
    """A joint carries `child` on `parent`; its angles are named, e.g. MP2_flexion."""

    parent: Name
    child: Name
    angles: tuple[Name, ...] = Field(
        max_length=3, description="one name a degree of freedom; none where both bones move as one"
    )
    type: Literal["saddle", "best"] | None = Field(
        None,
        description="of two angles: axes at any angle and distance (saddle), or what left-out poses favour "
        "(best); by default two orthogonal axes through one centre",
    )
    limits_deg: tuple[tuple[float, float], ...] | None = Field(
        None,
        description="[lower, upper] of each angle; by default what poses show, widened by published ranges",
    )
    axis_hints: tuple[Vector, ...] = Field(
        description="rough axis of each angle in the neutral frame: fixes its sign"
    )

    @model_validator(mode="after")
    def _lengths(self) -> Joint:
        limits = self.angles if self.limits_deg is None else self.limits_deg
        if not len(self.angles) == len(limits) == len(self.axis_hints):
            raise ValueError("angles, limits_deg and axis_hints need the same length")
        if self.type is not None and len(self.angles) != 2:
            raise ValueError(f"type: {self.type} is for joints of two angles")
        for lower, upper in self.limits_deg or ():
            if not -360 <= lower < upper <= 360:
                raise ValueError(f"limits_deg: [{lower:g}, {upper:g}] is no range of degrees")
        if any(sum(c * c for c in axis) < 1e-12 for axis in self.axis_hints):
            raise ValueError("axis_hints: an axis of zero length has no direction")
        return self


class Muscle(Model):
    """A template surface and where it attaches: `attachments` is JSON {bone: [template vertex ids]}."""

    template: Path
    attachments: Path
    landmarks: Path | None = Field(None, description="landmarks on the template: .mrk.json")


class Tendon(Model):
    """`path` is a .mrk.json curve of a few points along it in neutral, from its insertion outwards."""

    bones: tuple[Name, ...] = Field(
        min_length=1,
        description="bones that it passes, from that of its insertion outwards; they drive its hooks",
    )
    path: Path
    radius: float = Field(gt=0, le=20, description="rough radius in mm")

    @model_validator(mode="before")
    @classmethod
    def _no_bone(cls, given: Any) -> Any:
        if isinstance(given, dict) and "bone" in given:
            raise ValueError(
                "bone: is no field any more; remove it, the tendon inserts at the first of `bones`"
            )
        return given


class Nail(Model):
    """A nail: the bone that it moves with, and its patch of the skin."""

    bone: Name
    surface: Path = Field(description="the nail's patch of the neutral skin, an open surface in mm")


class Scanner(Model):
    """How a generated subject is imaged, where its generator asks."""

    spacing: float = Field(default=0.5, ge=0.2, le=3.0, description="voxel size in mm")
    bias: float = Field(default=0.2, ge=0, lt=1, description="amplitude of the bias field, as a share")
    noise: float = Field(
        default=0.03,
        ge=0,
        le=1,
        description="deviation of the Rician noise, as a share of marrow's intensity",
    )


class Images(Model):
    """How the images of a generated subject are made."""

    model: Literal["painted", "physics"] = Field(
        default="painted",
        description="levels painted by tissue, or signal equations and artefacts",
    )
    sequence: Literal["spin_echo", "gradient_echo_in_phase", "gradient_echo_opposed"] = "spin_echo"
    field: float = Field(default=3.0, description="T, 1.5 or 3")
    strength: Strength = Field(default="usual", description="of all effects that `effects` does not name")
    effects: dict[ImageEffect, Strength] = Field(default={}, description="strength of single effects")

    @field_validator("field")
    @classmethod
    def _known(cls, value: float) -> float:
        if value not in (1.5, 3.0):
            raise ValueError("relaxation times are known at 1.5 and at 3 T")
        return value


class Limb(Model):
    """Where the real images of a generated subject are, their unit, and the strokes on the neutral one."""

    unit: float = Field(gt=0, le=1000, description="mm a unit of lengths in the volumes' headers")
    shrunk: float = Field(
        default=1.0,
        gt=0,
        le=100,
        description="the limb is built so many times smaller: lengths in the pipeline are a hand's",
    )
    volumes: dict[Name, Path] = Field(description="file of each pose in `anatomy`")
    strokes: Path = Field(
        description="JSON of the strokes on the neutral volume, as polylines of voxels of the file"
    )


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


class Recording(Model):
    """Which part of a recording of tracked points a scene plays, and how its noise is filtered."""

    side: Literal["right", "left"] | None = Field(
        None, description="hand that is followed, mirrored if it is the other; by default the subject's"
    )
    rate: float = Field(24.0, gt=0, le=1000, description="frames of the scene a second of the recording")
    start: float = Field(0.0, ge=0, description="of the first frame: s after the hand's first row")
    count: int | None = Field(None, ge=1, description="number of frames; by default all")
    smooth: float = Field(0.03, ge=0, le=1, description="standard deviation in s of the Gaussian filter")
    bridge: float = Field(0.25, ge=0, le=5, description="longest gap in s that is bridged")


LEARNED_LEVELS = ("L0", "L1")  # of a scene: from the simulated frames of another one
LAYERS_AT = {"L2": ("bones", "muscles", "skin"), "L3": ("bones", "skin")}  # that a level has
WITHOUT_TETS = ("L0", "L1", "L2")


class Scene(Model):
    """Which layers, which frames. `skin` without `fat` is one soft tissue around the bones (Wang 2019)."""

    layers: tuple[str, ...]
    frames: Path = Field(
        description="CSV of joint angles in degrees, one frame a row, or of keyframes; BVH; hand landmarks "
        "(JSON, CSV); targets of inverse kinematics or random poses (YAML); contractions of muscles "
        "(CSV); a recording of tracked points (CSV)"
    )
    recording: Recording | None = Field(
        None, description="of tracked points in `frames`; the scene is skipped where that file is absent"
    )
    bones: dict[Name, str] = Field(
        {}, description="bone -> name of its joint in a BVH file, where the two differ"
    )
    only: tuple[Name, ...] | None = Field(
        None, min_length=1, description="bones or fingers that are modelled, with the bones that carry them"
    )
    chunk: int = Field(4, ge=1, description="frames in one job")
    obj: bool = Field(False, description="write the frames as a sequence of OBJ files, too")
    rigged: bool = Field(
        False, description="write a glTF with skeleton, skin weights and corrective shapes, too"
    )
    skeleton: bool = Field(
        False, description="write the skeleton with its tendons as models of MuJoCo and OpenSim, too"
    )
    mechanics: bool = Field(
        False, description="write strains, stresses, fibre stretch and contact pressure as VTU, too"
    )
    deviations: bool = Field(
        False, description="state how far each point is expected to be off, as an artifact and as VTU, too"
    )
    muscle_barrier: bool = Field(
        False,
        description="keep muscles out of bones, of one another and themselves: 4 to 6 times their time",
    )
    equilibria: bool = Field(
        False,
        description="look for other equilibria of frames from other starts: at least twice the time of fat",
    )
    movie: bool = Field(False, description="draw the frames as movies, too; with `images` also the volumes")
    images: bool = Field(False, description="move the neutral image with the frames, and into scanned poses")
    fidelity: Fidelity | None = Field(
        None, description="the fidelity that it is made for; a build of another one is refused"
    )
    level: Literal["L0", "L1", "L2", "L3", "full"] = Field(
        "full",
        description="`full` simulates; L0 skins, L1 adds correctives, both learned from `learned`; L2 has "
        "muscles that bulge and a skin of springs; L3 simulates one soft tissue with creases",
    )
    learned: str | None = Field(
        None, description="scene whose simulated frames `level` L0 or L1 is learned from"
    )

    @model_validator(mode="after")
    def _learned(self) -> Scene:
        if (self.level in LEARNED_LEVELS) != (self.learned is not None):
            raise ValueError("learned: names a scene of random poses, with `level` L0 or L1 and only then")
        if self.level in WITHOUT_TETS and (self.mechanics or self.equilibria):
            raise ValueError(f"level: {self.level} has no tets: neither mechanics nor equilibria of them")
        if self.level != "full" and self.deviations:
            raise ValueError(f"level: {self.level} has errors of its own: deviations are of `full` alone")
        if self.level == "L3" and self.equilibria:
            raise ValueError(
                "level: L3 bends from neutral: it has no other starts, and no equilibria of them"
            )
        return self

    @model_validator(mode="after")
    def _at_its_level(self) -> Scene:
        if self.level not in LAYERS_AT:
            return self
        known = LAYERS_AT[self.level]
        further = [layer for layer in self.layers if layer not in known]
        if further or (self.level == "L2" and self.images):
            wrong = f"has no {', '.join(further)}" if further else "moves no images"
            raise ValueError(f"level: {self.level} {wrong}; its layers are {', '.join(known)}")
        return self

    @model_validator(mode="after")
    def _known(self) -> Scene:
        known = organs()
        for layer in self.layers:
            if layer not in known:
                raise ValueError(f"layers: {layer!r} is not a layer; the layers are {', '.join(known)}")
        if self.images and not {"fat", "skin"} & set(self.needed):
            raise ValueError("images: need fat or skin among the layers: the skin bounds the moved image")
        if self.muscle_barrier and "muscles" not in self.needed:
            raise ValueError("muscle_barrier: needs muscles among the layers: it keeps these alone apart")
        if self.equilibria and not {"fat", "skin"} & set(self.needed):
            raise ValueError("equilibria: need fat or skin among the layers: they are sought for these alone")
        return self

    @property
    def needed(self) -> list[str]:
        """The scene's layers and all that they need, inside out."""
        return needed(self.layers)


def load_yaml(path: str | Path, model: type[T]) -> T:
    """Read and check a YAML file.

    Parameters
    ----------
    path : path
        File to read.
    model : class
        Pydantic model of its content.

    Returns
    -------
    model
        An instance of `model`.

    Raises
    ------
    InputError
        Where the file is missing or malformed, or a field is wrong; it names the first wrong field.
    """
    return checked(path, _content(path), model)


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]  # C: 4 times as fast
    """YAML whose mappings have each key once: of two equal keys, the first would be lost silently."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: list[Any] = []
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                problem = f"the key {key!r} stands twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            seen.append(key)
        return super().construct_mapping(node, deep)


def _content(path: str | Path) -> Any:
    try:
        return yaml.load(read_text(path), Loader=_Loader) or {}  # a safe loader
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(path, "YAML", " ".join(str(error).split()), "Mend the syntax") from error


def checked(path: str | Path, content: Any, model: type[T]) -> T:
    """A model of the content of a file.

    Parameters
    ----------
    path : path
        The file, for messages.
    content : object
        What YAML or JSON gives.
    model : class
        Pydantic model of the content.

    Returns
    -------
    model
        An instance of `model`.

    Raises
    ------
    InputError
        Where a field is wrong; it names the first wrong field.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise _fault(path, error.errors()[0]) from error


def _fault(path: str | Path, found: Mapping[str, Any]) -> InputError:
    """One error of pydantic as one of ours."""
    problem = found["msg"].removeprefix("Value error, ")
    field = ".".join(str(p) for p in found["loc"] if p != "[key]")
    if found["type"] == "string_pattern_mismatch":
        problem = (
            f"{found['input']!r} is no name: letters a to z, digits and {_joint_of(found)}, letter first"
        )
    if not field:  # checks of a whole file name the field themselves
        field, _, problem = problem.partition(": ") if ": " in problem else ("content", "", problem)
    return InputError(path, field, problem, "See config/README.md")


def every_fault(error: InputError) -> list[InputError]:
    """All that is wrong with the fields of a file, of which loading names the first.

    Parameters
    ----------
    error : InputError
        What `load_dataset`, `load_scene` or `settings_of` raised.

    Returns
    -------
    list of InputError
        `error` alone where it is of another kind.
    """
    if not isinstance(error.__cause__, ValidationError):
        return [error]
    return [_fault(error.source, found) for found in error.__cause__.errors()]


def _joint_of(error: Mapping[str, Any]) -> str:
    """The character allowed beside letters and digits in the pattern of names that an error names."""
    return "hyphens" if "-]" in error["ctx"]["pattern"] else "underscores"


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
    folder = Path("results") / Path(path).stem
    if not dataset.root.resolve().is_relative_to(folder.resolve()):
        problem = f"is {dataset.root}, but what is generated stays under {folder}"
        raise InputError(path, "root", problem, f"Write {folder}/data")
    written = dataset.model_dump(exclude={"root", "anatomy", "limb"}, exclude_none=True)
    for field, relative in _paths(written):
        if not dataset.path(relative).resolve().is_relative_to(dataset.root.resolve()):
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
    content = _content(path)
    if not isinstance(content, dict) or "like" not in content:
        return checked(path, content, Dataset)
    other = Path(path).with_name(f"{content['like']}.yaml")
    if not other.is_file():
        raise InputError(path, "like", f"there is no {other.name} beside it", "Name a dataset of that folder")
    further = _content(other)
    if "like" in further:
        raise InputError(path, "like", f"{other.name} is like another one itself", "Name that one")
    return checked(path, {**further, **content}, Dataset)


def load_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : path
        YAML file of the scene.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        As `load_yaml`.
    """
    return load_yaml(path, Scene)
