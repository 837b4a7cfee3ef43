"""Fields of dataset, scene and configuration, and the rules that have to run again after a change of each.

Nothing is built: what Snakemake compares of each job is taken before and after the change.
"""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin

import yaml

from benchmarks.trust.job_plans import JobPlan, plan
from handpipe.core import Metrics
from handpipe.core.configuration import Dataset, Model, Scene, load_dataset
from handpipe.core.configuration.settings import Settings
from handpipe.hand import named_files
from handpipe.skeleton.motion.tracks import COLUMNS

CHECKOUT = Path(__file__).parents[2]
POSES = ("neutral", "bow", "fist", "half")  # of the finger; fewer jobs, the same rules
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Change:
    """A new value of a field, and the rules whose jobs have to run again of themselves, not behind others.

    where: "person", a scanned subject with all that people may give; a generated subject's name; "scene";
    "tracked", a scene of tracked points; "learned", one at a level; or "config".
    """

    where: str
    field: str
    value: Any
    rules: frozenset[str]

    def __str__(self) -> str:
        return f"{self.where}: {self.field}"


def _changes(where: str, table: Mapping[str, tuple[Any, str]]) -> list[Change]:
    return [Change(where, field, value, frozenset(rules.split())) for field, (value, rules) in table.items()]


BY_TRUTH = (
    "evaluate_muscles evaluate_registration evaluate_segmentation evaluate_skin evaluate_tendons fit_rig"
)
IMAGE_READERS = (
    "correct_bone extract_muscle_shapes merge_labels register_bones register_tendon report segment_pose "
    "separate_fat_water"
)
ECHOES = [
    {"time_ms": time, "magnitude": f"echoes/{time}.nii.gz", "phase": f"echoes/{time}-phase.nii.gz"}
    for time in (3.45, 4.6, 5.75)
]
LOOK_READERS = "correct_bone propose_seeds segment_pose"
CHANGES = [
    *_changes(
        "person",
        {
            "root": (
                "moved",
                f"{BY_TRUTH} correct_bone extract_muscle extract_muscle_shapes extract_tendon "
                "fit_fat_strains make_bone_fascia make_muscle_fascia make_skin merge_labels place_templates "
                "register_bones register_tendon report segment_pose separate_fat_water",
            ),
            "hand": ("left", "evaluate_frames report simulate"),
            "licence": ("CC0-1.0", ""),  # of training sets
            "poses.fist.role": (
                "heldout",
                "collect_fat_strains evaluate_frames evaluate_muscles evaluate_poses evaluate_skin "
                "evaluate_tendons extract_muscle_shapes fit_hooks fit_muscle_strains fit_rig report",
            ),
            "poses.fist.volume": ("new/fist.nii.gz", IMAGE_READERS),
            "poses.fist.series": (2, IMAGE_READERS),
            "poses.fist.echo": (2, IMAGE_READERS),
            "poses.fist.channels.opposed": ("new/opposed.nii.gz", ""),
            "poses.fist.dixon.echoes": (ECHOES[:2], "separate_fat_water"),
            "poses.fist.dixon.field_T": (1.5, "separate_fat_water"),
            "poses.fist.seeds": ("new/seeds.nii.gz", "correct_bone merge_labels segment_pose"),
            "poses.fist.labels": (
                "new/labels.nii.gz",
                "correct_bone extract_muscle_shapes merge_labels segment_pose",
            ),
            "poses.fist.labels_show": ("marrow", "correct_bone merge_labels segment_pose"),
            "poses.fist.scan": ("new/fist.ply", "evaluate_skin fit_fat_strains report"),
            "poses.fist.scan_frame": ("own", "align_scan evaluate_skin fit_fat_strains report"),
            "skin_from_volume": (True, ""),
            "poses.fist.scribbles.distal2": ("new/distal2.nii.gz", "correct_bone merge_labels"),
            "poses.neutral.markers.lumbrical1": ("new/n.mrk.json", "extract_muscle"),
            "poses.fist.markers.lumbrical1": ("new/m.mrk.json", "extract_muscle_shapes"),
            "poses.fist.landmarks.lumbrical1": ("new/l.mrk.json", "extract_muscle_shapes"),
            "bones.distal2.label": (9, "correct_bone evaluate_segmentation merge_labels segment_pose"),
            "bones.distal2.template": ("new/distal2.ply", "place_templates"),
            "other_labels.sesamoid1": (9, "correct_bone merge_labels segment_pose"),
            "contrast": ("learned", "correct_bone merge_labels segment_pose"),
            "registration": ("surfaces", "register_bones"),
            "joints.DIP2.parent": (
                "proximal2",
                "fit_rig make_bone_fascia merge_labels mesh_flesh register_bones",
            ),
            "joints.DIP2.child": (
                "middle2",
                "fit_rig make_bone_fascia merge_labels mesh_flesh register_bones",
            ),
            "joints.MP2.angles": (["MP2_abduction", "MP2_flexion"], "fit_rig merge_labels register_bones"),
            "joints.MP2.type": ("saddle", "fit_rig"),
            "joints.DIP2.limits_deg": ([[-10, 70]], "fit_rig"),
            "joints.DIP2.axis_hints": ([[0, 1, 0.1]], "fit_rig register_bones"),
            "muscles.lumbrical1.template": ("new/lumbrical1.ply", "place_templates"),
            "muscles.lumbrical1.attachments": ("new/lumbrical1.json", "place_templates"),
            "muscles.lumbrical1.landmarks": ("new/lumbrical1.mrk.json", "place_templates"),
            "ligaments.PIP2_ulnar.template": ("new/ligament.ply", "place_templates"),
            "ligaments.PIP2_ulnar.attachments": ("new/ligament.json", "place_templates"),
            "ligaments.PIP2_ulnar.landmarks": ("new/ligament.mrk.json", "place_templates"),
            "tendons.flexor2.bones": (
                ["distal2", "middle2", "proximal2"],
                "extract_tendon fit_hooks register_tendon",
            ),
            "tendons.flexor2.path": ("new/flexor2.mrk.json", "extract_tendon"),
            "tendons.flexor2.radius": (1.9, "extract_tendon"),
            "nails.nail2.bone": ("middle2", "make_skin"),
            "nails.nail2.surface": ("new/nail.ply", "make_skin"),
            "drawn_in": (
                "template",
                "carry_template extract_tendon fit_rig make_skin place_templates register_bones",
            ),
            "muscle_interpolation": ("inverse-square", "fit_muscle_strains"),
            "regions.bone_fascia": ("new/bone.json", "make_bone_fascia"),
            "regions.muscle_fascia": ("new/muscle.json", "make_muscle_fascia"),
        },
    ),
    *_changes(
        "phantom-finger",
        {
            "seed": (2, "generate_pose generate_templates report"),
            "truth.folder": ("elsewhere", f"{BY_TRUTH} generate_pose report"),
            "joints.DIP2.limits_deg": ([[-10, 70]], "fit_rig"),
            "tendons.flexor2.radius": (1.9, "extract_tendon"),
        },
    ),
    *_changes(
        "phantom-hand",
        {
            "seed": (2, "generate_bones generate_seeds report"),
            "hand": ("left", "evaluate_frames generate_bones report simulate"),
            "scanner.spacing": (0.6, "generate_bones"),
            "scanner.bias": (0.1, "generate_bones"),
            "scanner.noise": (0.1, "generate_bones"),
            "images.model": ("physics", "generate_bones"),
            "images.sequence": ("gradient_echo_in_phase", "generate_bones"),
            "images.field": (1.5, "generate_bones"),
            "images.strength": ("severe", "generate_bones"),
            "images.effects": ({"noise": "severe"}, "generate_bones"),
            "joints.DIP2.limits_deg": ([[-10, 75]], "fit_rig propose_seeds"),
        },
    ),
    *_changes(
        "knee",
        {
            "limb.unit": (1.8, "paint_strokes prepare_image"),
            "limb.shrunk": (3.0, "paint_strokes prepare_image"),
            "limb.volumes.T": ("new.nii.gz", "prepare_image"),
            "limb.strokes": ("tests/data/knee/strokes-second.json", "paint_strokes"),
            "segmentation.marks": ("intensity", LOOK_READERS),
            "segmentation.level": ("local", LOOK_READERS),
            "segmentation.edges": (0.7, LOOK_READERS),
            "segmentation.around": (2.0, LOOK_READERS),
            "segmentation.neck": (1.0, LOOK_READERS),
        },
    ),
    *_changes(
        "scene",
        {
            "layers": (["bones", "skin"], "mesh_soft_tissue report simulate"),
            "frames": ("config/scenes/moved.csv", "evaluate_frames simulate"),
            "bones": ({"distal2": "Index3"}, "evaluate_frames simulate"),
            "only": (["index"], ""),  # all of the finger's bones
            "chunk": (5, "simulate"),
            "obj": (True, "export_obj require_frames"),
            "rigged": (True, "export_rigged require_frames"),
            "scan": (True, "export_scan require_frames"),
            "skeleton": (True, "export_skeleton require_frames"),
            "equilibria": (True, "evaluate_frames find_equilibria"),
            "muscle_barrier": (True, "simulate"),
            "follow": (True, "simulate"),
            "mechanics": (True, "export_mechanics require_frames"),
            "deviations": (
                True,
                "evaluate_deviations learn_deviations mesh_soft_tissue report require_frames "
                "simulate_passive_skin state_deviations",
            ),
            "movie": (True, "render_movie require_frames"),
            "images": (
                True,
                "evaluate_images mesh_soft_tissue move_image move_images report require_frames "
                "simulate_passive_skin",
            ),
            "fidelity": ("standard", ""),  # the build's
        },
    ),
    *_changes(
        "tracked",
        {
            "viscosity": (0.04, "simulate"),
            "recording.side": ("left", "expand_motion"),
            "recording.rate": (40, "expand_motion"),
            "recording.start": (0.05, "expand_motion"),
            "recording.count": (7, "expand_motion"),
            "recording.smooth": (0.05, "expand_motion"),
            "recording.bridge": (0.1, "expand_motion"),
        },
    ),
    *_changes(
        "learned",
        {
            "level": ("L1", "animate"),
            "learned": ("random-other", "animate expand_motion learn_levels simulate"),
            "delta_mush": (5, "export_scan"),
        },
    ),
    *_changes(
        "config",
        {
            "scenes": (
                ["bones-and-skin"],
                "evaluate_frames export_scene mesh_soft_tissue report require_frames simulate",
            ),
            "fidelity": (
                "paper",
                "extract_tendon make_bone_fascia make_muscle_fascia make_skin mesh_fat "
                "report separate_neutral",
            ),
            "edges.muscle": (1.9, "report separate_neutral"),
            "edges.fascia": (1.9, "make_bone_fascia make_muscle_fascia report"),
            "edges.bone_fascia": (1.9, "make_bone_fascia report"),
            "edges.muscle_fascia": (1.9, "make_muscle_fascia report"),
            "edges.tendon": (0.9, "extract_tendon report"),
            "edges.skin": (1.9, "make_skin report"),
            "edges.crease": (0.9, "report"),
            "edges.fat": (2.6, "mesh_fat report"),
            "edges.flesh": (2.6, "mesh_flesh report"),
            "interpolation": ("inverse-square", "collect_fat_strains report"),
            "truth": ("full", "report"),
        },
    ),
]
# Every field of a scanned subject's file is checked; whatever changes, so it is after these.
ALWAYS = {"person": {"check_subject"}}
# Fields that name the subject or its kind: with another value it is another subject, built anew.
IDENTITY = {"name", "like", "generator", "anatomy", "proportions", "units", "subjects"}
SCENE_OF = {
    "phantom-hand": "hand-poses",
    "knee": "knee",
    "tracked": "waves",
    "learned": "learned",
}  # of the others: flexion
KINDS = {
    "scene": "scene",
    "tracked": "scene",
    "learned": "scene",
    "config": "config",
}  # of schemas; of the others: dataset
SCENES = {"scene": "flexion", "tracked": "waves", "learned": "learned"}  # files of scenes, by `Change.where`
TRACKED = {
    "layers": ["bones", "skin"],
    "frames": "waves.csv",
    "chunk": 4,
    "follow": True,
    "recording": {"side": "right", "rate": 50, "count": 8},
}
LEARNED = {
    "layers": ["bones", "skin"],
    "frames": "config/scenes/flexion.csv",
    "chunk": 4,
    "level": "L0",
    "learned": "random-finger",
    "scan": True,
}


@dataclass
class Workbench:
    """A working folder where nothing is built, and the plans of its subjects as they are."""

    folder: Path

    def __post_init__(self) -> None:
        self._plans: dict[str, JobPlan] = {}

    @cached_property
    def contents(self) -> dict[str, dict[str, Any]]:
        """Datasets, the scene and the configuration as they are, by `Change.where`."""
        finger = _dataset(self.folder, "phantom-finger")
        finger["poses"] = {pose: finger["poses"][pose] for pose in POSES}
        scene = self.folder / "config" / "scenes" / "flexion.yaml"
        return {
            "phantom-finger": finger,
            "person": _person(finger),
            "phantom-hand": _dataset(self.folder, "phantom-hand"),
            "knee": _dataset(self.folder, "knee") | {"anatomy": "images"},
            "scene": yaml.safe_load(scene.read_text(encoding="utf-8")),
            "tracked": TRACKED,
            "learned": LEARNED,
            "config": {},
        }

    def before(self, where: str) -> JobPlan:
        """The plan of `all` of the subject of a change, without the change."""
        kind = where if where in SCENE_OF or where == "phantom-finger" else "person"
        if kind not in self._plans:
            for name in ("person", "phantom-finger", "phantom-hand", "knee"):
                self.write(f"datasets/{name}", self.contents[name])
            self.write("scenes/waves", self.contents["tracked"])
            self.write("scenes/learned", self.contents["learned"])
            self._plans[kind] = self.plan(kind)
        return self._plans[kind]

    def after(self, change: Change) -> JobPlan:
        """The plan with the change."""
        old, where = self.contents[change.where], change.where
        new = _with(old, change.field, change.value)
        if where == "config":
            return self.plan("person", **new)
        name = f"scenes/{SCENES[where]}" if where in SCENES else f"datasets/{where}"
        try:
            self.write(name, new)
            return self.plan("person" if where == "scene" else where)
        finally:
            self.write(name, old)

    def plan(self, kind: str, **config: Any) -> JobPlan:
        """The plan of a subject, or of the person with the scene "tracked" or "learned"."""
        subject = "person" if kind in SCENES else kind
        given = {"subjects": [subject], "scenes": [SCENE_OF.get(kind, "flexion")], **config}
        return plan(self.folder, ["all"], given)

    def write(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a file of the configuration, and empty files that a dataset of it names."""
        text = yaml.safe_dump(dict(content), sort_keys=False)
        (self.folder / "config" / f"{name}.yaml").write_text(text, encoding="utf-8")
        if name.startswith("datasets/") and ("generator" not in content or "limb" in content):
            for file in _files(content):
                path = self.folder / file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.touch()

    def unlike(self, change: Change) -> tuple[set[str], set[str]]:
        """Rules that a change does not rerun but has to, and rules that it reruns for nothing."""
        before = self.before(change.where)
        found = {job.rule for job in self.after(change).changed(before)} - {"all"}
        expected = change.rules | ALWAYS.get(change.where, set())
        return set(expected - found), found - expected


def write_waves(path: Path) -> None:
    """Write a recording of both hands: twenty rows of each, 10 ms apart."""
    rows = [",".join(COLUMNS)]
    for i in range(20):
        for side in ("left", "right"):
            cells = {"timestamp_us": 10_000 * i, "side": side, "confidence": 1}
            rows.append(",".join(str(cells.get(c, len(c) + i)) for c in COLUMNS))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _files(content: Mapping[str, Any]) -> list[Path]:
    if (limb := content.get("limb")) is not None:
        return [Path(limb["strokes"]), *(Path(content["anatomy"]) / v for v in limb["volumes"].values())]
    try:
        return [*named_files(Dataset.model_validate(content)).values()]
    except ValueError:  # the workflow will say what is wrong
        return []


@contextmanager
def workbench() -> Iterator[Workbench]:
    """A temporary working folder."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("workflow", "config", "profiles"):
            shutil.copytree(CHECKOUT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(CHECKOUT / "Snakefile", folder)
        scenes = folder / "config" / "scenes"
        shutil.copy(scenes / "flexion.csv", scenes / "moved.csv")
        shutil.copy(scenes / "random-finger.yaml", scenes / "random-other.yaml")
        write_waves(folder / "waves.csv")
        yield Workbench(folder)


def _person(finger: Mapping[str, Any]) -> dict[str, Any]:
    """The generated finger as a scanned subject, with all that people may add."""
    found = deepcopy(dict(finger)) | {"name": "person", "root": "person"}
    for key in ("generator", "truth", "seed"):
        del found[key]
    found["poses"]["fist"]["scribbles"] = {"distal2": "scribbles/fist.nii.gz"}
    found["poses"]["fist"]["channels"] = {"opposed": "echoes/opposed.nii.gz"}
    found["poses"]["fist"]["dixon"] = {"echoes": ECHOES, "field_T": 3.0}
    for pose in ("neutral", "fist"):
        for kind in ("markers", "landmarks"):
            found["poses"][pose][kind] = {"lumbrical1": f"{kind}/{pose}.mrk.json"}
    found["muscles"]["lumbrical1"]["landmarks"] = "templates/lumbrical1.mrk.json"
    found["joints"]["MP2"]["limits_deg"] = [[-20, 90], [-20, 90]]  # so that its angles can change names
    found["regions"] = {kind: f"regions/{kind}.json" for kind in ("bone_fascia", "muscle_fascia")}
    return found


def _dataset(folder: Path, subject: str) -> dict[str, Any]:
    """A dataset's content, completed by the one that it is like."""
    data = load_dataset(folder / "config" / "datasets" / f"{subject}.yaml")
    return data.model_dump(mode="json", exclude_defaults=True)


def _with(content: Mapping[str, Any], field: str, value: Any) -> dict[str, Any]:
    found = deepcopy(dict(content))
    *path, last = field.split(".")
    inner = found
    for key in path:
        inner = inner.setdefault(key, {})
    inner[last] = value
    if field == "joints.DIP2.child":  # the joints have to stay a tree: the two outer bones change places
        inner["parent"], found["joints"]["PIP2"]["child"] = "distal2", "distal2"
    return found


def fields(model: type[Model], before: str = "") -> Iterator[str]:
    """Every field of a model, entries of mappings as "*"."""
    for name, field in model.model_fields.items():
        kind = field.annotation
        if get_origin(kind) in (Union, UnionType):
            kind = next(a for a in get_args(kind) if a is not type(None))
        if get_origin(kind) is dict:
            name, kind = f"{name}.*", get_args(kind)[1]
        if isinstance(kind, type) and issubclass(kind, Model):
            yield from fields(kind, f"{before}{name}.")
        else:
            yield f"{before}{name}"


def unchecked_fields(changes: Sequence[Change] = CHANGES) -> set[str]:
    """Fields of the schemas that no change of the table is about, and that do not name the subject."""
    found = set()
    for kind, model in (("scene", Scene), ("config", Settings), ("dataset", Dataset)):
        given = [c.field for c in changes if KINDS.get(c.where, "dataset") == kind]
        for field in fields(model):
            if field not in IDENTITY and not any(_is(field, name) for name in given):
                found.add(f"{kind}: {field}")
    return found


def _is(field: str, name: str) -> bool:
    """Whether a name, as "bones.distal2.label", is of a field, as "bones.*.label"."""
    parts, names = field.split("."), name.split(".")
    if parts[-1] == "*" and len(names) == len(parts) - 1:  # a mapping as a whole
        parts = parts[:-1]
    return len(parts) == len(names) and all(p in ("*", n) for p, n in zip(parts, names, strict=True))


def measure(results: Path) -> Metrics:
    """`stale_fields`: fields whose change leaves a job as it was that has to run; of `fields_checked`."""
    stale, needless = 0, 0
    with workbench() as bench:
        for change in CHANGES:
            missing, extra = bench.unlike(change)
            if missing or extra:
                log.info("%s: not rerun: %s; rerun for nothing: %s", change, sorted(missing), sorted(extra))
            stale, needless = stale + bool(missing), needless + bool(extra)
    return {
        "stale_fields": (stale + len(unchecked_fields()), "1"),
        "fields_rerunning_for_nothing": (needless, "1"),
        "fields_checked": (len(CHANGES), "1"),
    }
