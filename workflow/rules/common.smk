# Helpers of the rules: datasets and scenes by name, the build's lock. No rules here.

import atexit
import fcntl
import functools
import re
from pathlib import Path

import handpipe
from snakemake.caching.rule import CacheFlag
from snakemake.exceptions import WorkflowError

from handpipe.core import (
    LAYERS,
    CodeDigests,
    HandpipeError,
    artifacts_of,
    inner_layers,
    needed,
    paths,
)
from handpipe.core.configuration import (
    Role,
    load_dataset,
    load_scene,
    require_fidelity,
    selection,
    settings_of,
)
from handpipe.hand import (
    failures_in,
    joint_limits,
    layer_loading,
    named_files,
    names_of_labels,
    part_of,
    require_files,
    require_plain,
    require_seeds,
    require_skin,
)
from handpipe.imaging.volumes import labelled_names
from handpipe.levels import require_learned
from handpipe.skeleton.drivers import frame_names
from handpipe.skeleton.motion import is_motion, is_random_file, motion_frame_names
from handpipe.stages.baselines.variants import VARIANTS
from handpipe.synthetic import generators


def checked(load, *arguments):
    """Call a loader; what a person can mend ends the workflow with one message."""
    try:
        return load(*arguments)
    except HandpipeError as error:
        raise WorkflowError(f"handpipe: {error}") from None


SETTINGS = checked(
    settings_of, config, "configuration (config/config.yaml, --configfile or --config)"
)


def playable_scenes():
    """Scenes of the configuration whose recordings are here; others are skipped with a reason."""
    kept = []
    for name in SETTINGS.scenes:
        try:
            made = load_scene(f"config/scenes/{name}.yaml")
        except HandpipeError:  # said where the scene is needed
            kept.append(name)
            continue
        if made.recording is not None and not made.frames.exists():
            logger.warning(
                f"handpipe: scene {name} is skipped: its recording {made.frames} is not on this machine"
            )
        else:
            kept.append(name)
    if SETTINGS.scenes and not kept:
        raise WorkflowError("handpipe: scenes: the recording of every scene is absent")
    return kept


SETTINGS = SETTINGS.model_copy(update={"scenes": tuple(playable_scenes())})


@functools.cache
def dataset(subject):
    """The part of a subject that the scenes model; all other parts of its file are as if they were not there."""
    scenes = {
        Path(f"config/scenes/{name}.yaml"): scene(name) for name in SETTINGS.scenes
    }
    file = Path(dataset_file(subject))
    part = checked(part_of, scenes, file, whole_dataset(subject))
    if part.left_out:
        logger.warning(
            f"handpipe: {subject}: left out, with the bones that `only` would have to name: {part}"
        )
    return part.dataset


@functools.cache
def whole_dataset(subject):
    """All that a subject has, for generators and for the check of its files."""
    data = checked(read_dataset, Path(dataset_file(subject)))
    checked(generators.require_known, dataset_file(subject), data)
    if not data.generator:
        checked(require_files, dataset_file(subject), data)
    return data


@functools.cache
def read_dataset(file):
    return load_dataset(file)


def dataset_file(subject):
    return f"config/datasets/{subject}.yaml"


@functools.cache
def selected(of, subject, fields, names):
    """Fields of a dataset as text: a parameter of rules, of which their script makes the dataset."""
    return selection.select(of(subject), fields, **dict(names))


def reads(*fields, of=dataset):
    """Parameter function: the fields of the dataset that the rule's script reads, and no others.

    Fields are those of `handpipe.core.configuration.selection`; wildcards stand in braces, and {neutral},
    {examples} and {proposed} for the names of such poses. A change of another field does not rerun the rule.
    """

    def values(wildcards):
        data = of(wildcards.subject)
        names = {
            **dict(wildcards.items()),
            "neutral": data.neutral,
            "examples": tuple(data.examples),
            "proposed": tuple(proposed_poses(wildcards.subject)),
        }
        return selected(of, wildcards.subject, fields, tuple(names.items()))

    return values


def reads_whole(*fields):
    """As `reads`, of all that the subject has, whatever part of it the scenes model."""
    return reads(*fields, of=whole_dataset)


def image_of(pose="{pose}"):
    """Fields of the dataset that `pose_volume` reads of a pose."""
    return ["root", *(f"poses.{pose}.{part}" for part in ("volume", "series", "echo"))]


def of_labels(wildcards):
    """Parameter function: the fields that merging the labels of a pose reads; joints, too, in neutral."""
    fields = [
        *image_of(),
        "bones.*.label",
        "other_labels",
        "contrast",
        "neutral",
        "poses.{pose}.scribbles",
        "poses.{pose}.labels_show",
    ]
    if wildcards.pose == neutral(wildcards.subject):
        fields += ["joints.*.parent", "joints.*.child", "joints.*.angles"]
    return reads(*fields)(wildcards)


def reads_with_channels(*fields):
    """As `reads`, and the pose's channels where the bones' look is learned from them."""

    def values(wildcards):
        learned = dataset(wildcards.subject).contrast == "learned"
        return reads(*fields, *(["poses.{pose}.channels"] if learned else []))(
            wildcards
        )

    return values


def reads_with_maps(poses, *fields):
    """As `reads`, and what the reading of muscles in label maps needs where one of the poses has a map.

    poses: names of poses by subject.
    """

    def values(wildcards):
        data = dataset(wildcards.subject)
        if all(data.poses[pose].labels is None for pose in poses(data)):
            return reads(*fields)(wildcards)
        names = ("bones.*.label", "other_labels", "muscles.names")
        return reads(*fields, *names)(wildcards)

    return values


def reads_scene(*fields):
    """Parameter function: the same of the fields of a scene."""
    return lambda w: selection.select(scene(w.scene), fields)


def layer_fields(layers):
    """What the loading of layers reads of the dataset."""
    return [field for layer in layers for field in LAYERS[layer].fields]


def of_layers(layers, *further):
    """Parameter function: the fields of the dataset that a simulation of layers reads, and further ones.

    layers: names of the layers by wildcards.
    """
    return lambda w: reads(*further, *layer_fields(layers(w)))(w)


SCENE_NAME = "[A-Za-z][A-Za-z0-9_-]*"


@functools.cache
def scene(name):
    if not re.fullmatch(SCENE_NAME, str(name)):
        raise WorkflowError(
            f"handpipe: scenes: {name!r} is no name of a scene. Name its file with a letter first, "
            "then letters, digits, _ and -"
        )
    file = f"config/scenes/{name}.yaml"
    found = checked(load_scene, file)
    checked(require_fidelity, file, found, SETTINGS)
    if found.learned is not None:
        checked(require_learned, file, found, scene(found.learned))
    return found


@functools.cache
def level_of_scenes():
    """Level by scene, of all files of scenes that are right."""
    found = {}
    for file in sorted(Path("config/scenes").glob("*.yaml")):
        try:
            found[file.stem] = load_scene(file).level
        except HandpipeError:  # said where the scene is needed
            continue
    return found


def scenes_at(*levels):
    """A pattern for the scenes at some levels; "-", which is no scene, without any."""
    return (
        "|".join(n for n, level in level_of_scenes().items() if level in levels) or "-"
    )


def muscles_of_scene(wildcards):
    """The muscles that bulge in a scene at level L2: those of the subject, if the scene has the layer."""
    if "muscles" not in scene(wildcards.scene).layers:
        return []
    return layer_files(wildcards.subject, ["muscles"])


def buildable_subjects():
    """Subjects of the configuration whose source data are here; others are skipped with a reason."""
    kept = []
    for subject in SETTINGS.subjects:
        source = whole_dataset(subject).anatomy
        if source is not None and not source.exists():
            logger.warning(
                f"handpipe: {subject} is skipped: its anatomy {source} is not on this machine"
            )
        else:
            kept.append(subject)
    return kept


@functools.cache
def right_datasets():
    """Datasets by subject, of all files that are right: a mistake in one is the matter of its own subject."""
    found = {}
    for file in sorted(Path("config/datasets").glob("*.yaml")):
        try:
            found[file.stem] = read_dataset(file)
        except HandpipeError:  # said where the subject is needed
            continue
    return found


def subjects_made_by(wanted):
    """A pattern for the generated subjects that are wanted; "-", which is no subject, where there are none.

    wanted: of the generator's record and the dataset.
    """
    found = []
    for subject, data in right_datasets().items():
        record = generators.GENERATORS.get(data.generator)
        if record is not None and wanted(record, data):
            found.append(subject)
    return "|".join(found) or "-"


def has_scans(data):
    """Whether a dataset names a skin scan."""
    return any(pose.scan is not None for pose in data.poses.values())


# Images and truth of bones alone, by a module; truth of a simulation of one body, of bodies that slide; real images
# of a limb.
BONES_ALONE = subjects_made_by(
    lambda record, data: record.module is not None and not has_scans(data)
)
COUPLED = subjects_made_by(lambda record, data: record.truth == "coupled")
SLIDING = subjects_made_by(lambda record, data: record.truth == "sliding")
LIMBS = subjects_made_by(lambda record, data: record.truth is None)


def with_template(kind):
    """A pattern for the hands whose template of all organs is made of curves or of surfaces.

    It is a right hand's; a left hand that is posed by a coupled simulation is its mirror image.
    """
    return subjects_made_by(
        lambda record, data: record.template == kind
        and (data.hand == "right" or record.truth == "coupled")
    )


def generator(subject):
    """The record of a subject's generator; None where its files are given."""
    name = whole_dataset(subject).generator
    return None if name is None else generators.GENERATORS[name]


def made_by_simulation():
    """Subjects of the configuration whose truth is a simulation."""
    return [
        s
        for s in buildable_subjects()
        if generator(s) and generator(s).truth in ("coupled", "sliding")
    ]


def each_subject(pattern):
    """The files of a pattern for every subject, over its own ligaments and scenes."""
    return [
        path
        for subject in buildable_subjects()
        for path in expand(
            pattern,
            subject=subject,
            ligament=list(dataset(subject).ligaments),
            scene=SETTINGS.scenes,
        )
    ]


HELD_LOCKS = []


def take_lock():
    """Two builds in one folder would write the same files. The system frees the lock when a build is killed."""
    file = open(".snakemake/handpipe.lock", "w")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise WorkflowError(
            "handpipe: another build runs in this folder. Wait for it or stop it"
        ) from None
    HELD_LOCKS.append(
        file
    )  # a file that nothing refers to is closed, and its lock is gone


def source_image(subject, pose):
    """The file of a real limb's pose, as it was acquired."""
    data = whole_dataset(subject)
    return data.anatomy / data.limb.volumes[pose]


def given_files(wildcards):
    """Every file that a dataset names."""
    return list(named_files(whole_dataset(wildcards.subject)).values())


def subject_checks():
    """The checks of scanned subjects. Every target has them; no job waits for them.

    As an input of the segmentation the check would have to be `ancient`, for a scan does not change images;
    but Snakemake does not look at the parameters of jobs behind an ancient input that is made anew.
    """
    scanned = [s for s in buildable_subjects() if not dataset(s).generator]
    return expand(paths.CHECK, subject=scanned)


def neutral(subject):
    return dataset(subject).neutral


def of_pose(field):
    """Input function: a file of the wildcards' pose as the dataset names it; absent optional files give none."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        if wildcards.pose not in data.poses:
            raise WorkflowError(
                f"handpipe: {dataset_file(wildcards.subject)}: poses.{wildcards.pose}: is not a pose of "
                f"this subject. The poses are {', '.join(data.poses)}"
            )
        path = getattr(data.poses[wildcards.pose], field)
        return [] if path is None else data.path(path)

    return files


def echoes_of_pose(wildcards):
    """Input function: magnitude and phase of every echo of the pose, in the order of the dataset file."""
    data = dataset(wildcards.subject)
    dixon = data.poses[wildcards.pose].dixon
    if dixon is None:
        raise WorkflowError(
            f"handpipe: {dataset_file(wildcards.subject)}: poses.{wildcards.pose}.dixon: is not given, but "
            "fat and water are separated from it. Name its echoes"
        )
    return [data.path(p) for e in dixon.echoes for p in (e.magnitude, e.phase)]


def separated_images():
    """The figures of fat and water of every pose with Dixon echoes."""
    return [
        paths.at(paths.FAT_WATER, subject=subject, pose=name)
        for subject in buildable_subjects()
        for name, pose in dataset(subject).poses.items()
        if pose.dixon is not None
    ]


def channels_of_pose(wildcards):
    """Input function: the pose's further volumes, of which bones are learned; none where none are."""
    data = dataset(wildcards.subject)
    if data.contrast != "learned":
        return []
    return [data.path(p) for p in data.poses[wildcards.pose].channels.values()]


def registered_images(wildcards):
    """Input function: the images of neutral and of the pose, where they refine the registration."""
    data = dataset(wildcards.subject)
    if data.registration != "images":
        return []
    return volumes(wildcards.subject, [data.neutral, wildcards.pose])


def reads_registered(*fields):
    """As `reads`, and what the reading of the images needs where they refine the registration."""

    def values(wildcards):
        if dataset(wildcards.subject).registration != "images":
            return reads(*fields)(wildcards)
        return reads(*fields, *image_of("{neutral}"), *image_of())(wildcards)

    return values


def seeds_of_pose(wildcards):
    """The pose's seeds as the dataset names them, none where a label map answers; else the proposed ones."""
    given = of_pose("seeds")(wildcards)
    if given or wildcards.pose not in proposed_poses(wildcards.subject):
        return given
    return paths.at(paths.SEEDS, **wildcards)


@functools.cache
def in_label_map(subject, pose):
    """What a person's label map of a pose holds, by the names of the dataset; every name is checked."""
    data = whole_dataset(subject)
    file = data.poses[pose].labels
    if file is None:
        return ()
    names = names_of_labels(data)
    return tuple(checked(labelled_names, data.path(file), data.seed_labels, names))


@functools.cache
def proposed_poses(subject):
    """Poses whose seeds are proposed: without seeds, and with bones that no label map of theirs holds."""
    data = dataset(subject)
    missing = {
        name: [b for b in data.bones if b not in in_label_map(subject, name)]
        for name, pose in data.poses.items()
        if pose.seeds is None
    }
    whole = len(data.bones) == len(whole_dataset(subject).bones)
    checked(require_seeds, dataset_file(subject), data, missing, whole)
    return [name for name, bones in missing.items() if bones]


def in_poses(pattern, *roles):
    """Input function: a pattern over the subject's poses of the given roles (all where none is given)."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        poses = data.poses_of(*(roles or Role))
        return expand(pattern, pose=poses, allow_missing=True)

    return files


def in_neutral(pattern):
    """Input function: the file of a pattern in the subject's neutral pose."""
    return lambda w: paths.at(pattern, subject=w.subject, pose=neutral(w.subject))


def in_truth(pattern, *roles):
    """Input function: the truth in poses of the given roles, where the subject has one.

    pattern: of a generated subject's file; a person's truth has files of the same names.
    """

    def files(wildcards):
        data = dataset(wildcards.subject)
        if data.truth is None:
            return []
        if data.generator:
            return in_poses(pattern, *roles)(wildcards)
        name = Path(pattern).name
        folder = data.path(data.truth.folder)
        return [folder / name.format(pose=p) for p in data.poses_of(*(roles or Role))]

    return files


def true_labels(wildcards):
    """Input function: true labels in every pose, of whole bones in neutral and of marrow elsewhere."""
    bones, marrow = (
        in_truth(pattern)(wildcards)
        for pattern in (paths.TRUE_BONES, paths.TRUE_MARROW)
    )
    is_neutral = [
        p == neutral(wildcards.subject) for p in dataset(wildcards.subject).poses
    ]
    return [b if n else m for b, m, n in zip(bones, marrow, is_neutral)]


def costs_of(*rules):
    """Parameter function: the folders of the benchmark files of some rules' jobs.

    They are no inputs: figures tell what jobs took where that is known, and no result depends on them.
    """
    return lambda w: [
        str(paths.at(paths.costs_of(rule), subject=w.subject)) for rule in rules
    ]


def in_flesh(*roles):
    """Input function: the flesh in poses of the given roles, where the subject has one."""

    files = in_poses(paths.POSE_FLESH, *roles)
    return lambda w: files(w) if dataset(w.subject).fleshed else []


def layer_files(subject, layers):
    """The artifacts that a simulation of the layers reads."""
    return [
        paths.at(f"{paths.SUBJECT}/{path}", subject=subject)
        for path in artifacts_of(layers, dataset(subject))
    ]


def tendons_of_scene(wildcards):
    """The tendons of a scene that has them."""
    if "tendons" not in scene(wildcards.scene).needed:
        return []
    return layer_files(wildcards.subject, ["tendons"])


def simulated_files(wildcards):
    """The artifacts that a simulation of a scene reads; at level L3 the soft tissue is the one with creases."""
    made = scene(wildcards.scene)
    files = layer_files(wildcards.subject, made.needed)
    plain, creased = (
        paths.at(path, subject=wildcards.subject)
        for path in (paths.SOFT_TISSUE, paths.CREASE_TISSUE)
    )
    if made.level != "L3":
        return files
    return [creased if file == plain else file for file in files]


def scene_layers():
    """The layers that any scene needs, inside out."""
    return needed(layer for name in SETTINGS.scenes for layer in scene(name).layers)


def inner_name(layers):
    """Name of the file of a scanned pose with layers under the fat: "inner" is all of them."""
    given = [layer for layer in inner_layers() if layer in layers]
    return "inner" if given == inner_layers() else "-".join(["inner", *given])


def layers_in(name):
    """The layers of a file that `inner_name` names."""
    return name.split("-")[1:] or inner_layers()


def flesh_under_inner(wildcards):
    """The flesh of a scanned pose, where one of its layers needs it."""
    needs = any("flesh" in LAYERS[layer].needs for layer in layers_in(wildcards.inner))
    if not needs or not dataset(wildcards.subject).fleshed:
        return []
    return paths.at(paths.POSE_FLESH, **wildcards)


def muscle_poses(subject):
    """Scanned poses with the muscles and what else the scenes need under the fat, to compare with truth."""
    data = dataset(subject)
    layers = scene_layers()
    name = inner_name(layers if "muscles" in layers else needed(["muscles"]))
    poses = data.poses_of(Role.example, Role.heldout)
    return expand(paths.POSE_LAYERS, subject=subject, pose=poses, inner=name)


@functools.cache
def frames(subject, name):
    """Names of a scene's frames; the file is checked here, angles against limits too, not after hours of fitting."""
    data, made = dataset(subject), scene(name)
    checked(require_plain, f"config/scenes/{name}.yaml", "frames", made.frames)
    bones = [data.root_bone, *(b for b in data.bones if b != data.root_bone)]
    limits = joint_limits(data)
    if is_motion(made.frames) or made.recording is not None:
        return checked(
            motion_frame_names, made.frames, limits, bones, data.hand, made.recording
        )
    return checked(frame_names, made.frames, limits, bones, made.bones)


def described_frames(wildcards):
    """The file that describes a scene's frames, found to be right."""
    frames(wildcards.subject, wildcards.scene)
    return scene(wildcards.scene).frames


def frames_file(wildcards):
    """The file of a scene's frames; of a motion, the angles that are made of it."""
    described = described_frames(wildcards)
    if is_motion(described):
        return paths.at(paths.SCENE_ANGLES, **wildcards)
    return described


def motion_table(wildcards):
    """The figures of a motion's frames; none where the scene's file has the frames themselves."""
    if not is_motion(described_frames(wildcards)):
        return []
    return paths.table_of("motion-{scene}").format(**wildcards)


def chunks(subject, name):
    """Numbers of the jobs into which a scene's frames are cut."""
    return range(-(-len(frames(subject, name)) // scene(name).chunk))


def scene_chunks(wildcards):
    """A scene's frames, in order."""
    numbers = chunks(wildcards.subject, wildcards.scene)
    return expand(paths.SCENE_CHUNK, **wildcards, chunk=numbers)


def random_frames(wildcards):
    """The file of a scene's random poses; other scenes make no training set: their frames are alike."""
    described = described_frames(wildcards)
    if not is_motion(described) or not is_random_file(described):
        raise WorkflowError(
            f"handpipe: config/scenes/{wildcards.scene}.yaml: frames: {described} asks for no random poses, of "
            "which a training set is made. Name a file with `random` (docs/how-to/motion.md)"
        )
    return described


def scene_shards(wildcards):
    """The shards of a scene's training set, in order."""
    numbers = chunks(wildcards.subject, wildcards.scene)
    return expand(paths.SCENE_SHARD, **wildcards, chunk=numbers)


def scene_equilibria(wildcards):
    """What other equilibria the frames have, where the scene asks for it."""
    if not scene(wildcards.scene).equilibria:
        return []
    numbers = chunks(wildcards.subject, wildcards.scene)
    return expand(paths.SCENE_EQUILIBRIA, **wildcards, chunk=numbers)


def chunks_of_scenes(wildcards):
    """The frames of all scenes of a subject."""
    subject = wildcards.subject
    return [
        path
        for name in SETTINGS.scenes
        for path in expand(
            paths.SCENE_CHUNK, subject=subject, scene=name, chunk=chunks(subject, name)
        )
    ]


def set_aside_failed_chunks():
    """Keep only the finished frames of chunks with failed ones: the next build makes these chunks again.

    At the end of a build, when no other job reads them.
    """
    for subject in SETTINGS.subjects:
        folder = paths.at(paths.SIMULATION, subject=subject)
        for chunk in folder.glob(paths.SCENE_CHUNKS):
            try:
                failed = failures_in(chunk)
            except HandpipeError:
                continue  # what reads the chunk next says so
            if failed:
                chunk.replace(paths.partial_chunk(chunk))


def obj_sequences():
    """Folders of OBJ files, of the scenes that ask for them."""
    asked = [name for name in SETTINGS.scenes if scene(name).obj]
    return expand(paths.SCENE_OBJ, subject=buildable_subjects(), scene=asked)


def views():
    """Moved neutral images, files for riggers and analysts, and movies, of the scenes that ask for them."""
    asked = {
        paths.SCENE_IMAGES: lambda s: s.images,
        paths.SCENE_RIGGED: lambda s: s.rigged,
        paths.SCENE_SKELETON: lambda s: s.skeleton,
        paths.SCENE_MECHANICS: lambda s: s.mechanics,
        paths.SCENE_DEVIATIONS: lambda s: s.deviations,
        paths.SCENE_MOVIE: lambda s: s.movie,
        paths.SCENE_ANATOMY_MOVIE: lambda s: s.movie and s.images,
    }
    return [
        file
        for path, wants in asked.items()
        for file in expand(
            path,
            subject=buildable_subjects(),
            scene=[name for name in SETTINGS.scenes if wants(scene(name))],
        )
    ]


def poses_with_moved_images(subject):
    """Scanned poses into which the neutral image is moved: with fat, where a scene asks for images."""
    asked = any(scene(name).images for name in SETTINGS.scenes)
    return scanned(subject) if asked and "fat" in scene_layers() else []


def states_deviations():
    """Whether a scene asks how far points are expected to be off."""
    return any(scene(name).deviations for name in SETTINGS.scenes)


def layers_in_poses(*roles):
    """Input function: the layers under the fat that the scenes need, simulated in the poses of some roles."""
    return lambda w: expand(
        paths.POSE_LAYERS,
        subject=w.subject,
        pose=dataset(w.subject).poses_of(*roles),
        inner=inner_name(scene_layers()),
    )


def of_layer(layer, files):
    """Input function: what another one gives, where the scenes have a layer and the subject has bodies for it."""

    def wanted(subject):
        return layer in scene_layers() and getattr(dataset(subject), layer, True)

    return lambda w: files(w) if wanted(w.subject) else []


def posed_tendons(wildcards):
    """The tendons in the example poses, tendon by tendon."""
    data = dataset(wildcards.subject)
    return [
        path
        for tendon in data.tendons
        for path in expand(
            paths.POSED_TENDON,
            subject=wildcards.subject,
            tendon=tendon,
            pose=data.examples,
        )
    ]


def where_neutral_is(wildcards):
    """Input function: the neutral pose, from which every other one is followed."""
    return (
        []
        if wildcards.pose == neutral(wildcards.subject)
        else in_neutral(paths.COUPLED_POSE)(wildcards)
    )


def ablated_subjects():
    """Subjects that have every layer; others are named and left out."""
    kept = []
    for subject in buildable_subjects():
        data = dataset(subject)
        lacks = [name for name in ("tendons", "muscles") if not getattr(data, name)]
        if lacks:
            logger.warning(
                f"handpipe: {subject} has no ablations: it has no {' and no '.join(lacks)}"
            )
        else:
            kept.append(subject)
    return kept


def variants_of(subject):
    """Variants that the subject can have: true organs with a truth, no flesh where it has one."""
    data = dataset(subject)
    return [
        name
        for name, variant in VARIANTS.items()
        if (data.truth is not None or not variant.true)
        and (data.fleshed or "flesh" not in variant.without)
    ]


def ablated_layer_files(wildcards):
    """Input function: the artifacts of the layers that a variant simulates, its own where it has them."""
    variant, own = VARIANTS[wildcards.variant], paths.at(paths.ABLATION, **wildcards)
    full = paths.at(paths.SUBJECT, subject=wildcards.subject)
    return [
        own / path.relative_to(full) if layer in variant.refitted else path
        for layer in variant.loaded
        for path in layer_files(wildcards.subject, [layer])
    ]


def flesh_under_variant(wildcards):
    """Input function: the full model's flesh of a pose, where a layer of the variant needs it."""
    variant = VARIANTS[wildcards.variant]
    needs = any("flesh" in LAYERS[layer].needs for layer in variant.loaded)
    given = "flesh" not in (*variant.without, *variant.loaded)
    if needs and given and dataset(wildcards.subject).fleshed:
        return paths.at(
            paths.POSE_FLESH, subject=wildcards.subject, pose=wildcards.pose
        )
    return []


def of_variant(pattern, is_own):
    """Input function: a file of the variant where it has its own, else that of the full model."""
    return lambda w: (
        paths.ablated(pattern) if is_own(VARIANTS[w.variant]) else pattern
    )


def of_ablations(pattern):
    """Input function: a variant's file over all variants and scanned poses of the subject."""
    return lambda w: expand(
        paths.ablated(pattern),
        variant=variants_of(w.subject),
        pose=scanned(w.subject),
        allow_missing=True,
    )


def scribbles(subject, pose, bone):
    """Extra seeds of one bone: a change there reruns that bone alone."""
    data = dataset(subject)
    extra = data.poses[pose].scribbles.get(bone)
    if extra is None:
        raise WorkflowError(
            f"handpipe: {dataset_file(subject)}: poses.{pose}.scribbles.{bone}: is not given. "
            "A bone without scribbles is in the pose's bones.h5"
        )
    return data.path(extra)


def all_scribbles(wildcards):
    """The scribbles of a pose, in the order of its corrected bones."""
    data = dataset(wildcards.subject)
    return [data.path(file) for file in data.poses[wildcards.pose].scribbles.values()]


def scribbled_bones(wildcards, input):
    """Bones that may lack seeds. As a function of `input` it reruns nothing: it decides failure alone."""
    return [*dataset(wildcards.subject).poses[wildcards.pose].scribbles]


def corrected_bones(wildcards):
    """The bones of a pose that have scribbles, each segmented again with them."""
    return expand(
        paths.CORRECTED,
        bone=dataset(wildcards.subject).poses[wildcards.pose].scribbles,
        allow_missing=True,
    )


def neutral_looks(wildcards):
    """How the bones look in neutral: what those of another pose are compared with."""
    pose = neutral(wildcards.subject)
    if wildcards.pose == pose:
        return []
    return in_neutral(paths.LOOKS)(wildcards)


def template_files(subject):
    """The subject's templates: the generated folder, or the files that the dataset names."""
    data = dataset(subject)
    if data.generator:
        return [data.path("templates")]
    organs = [*data.muscles.values(), *data.ligaments.values()]
    files = [o.template for o in organs] + [o.attachments for o in organs]
    files += [o.landmarks for o in organs if o.landmarks]
    files += [b.template for b in data.bones.values() if b.template]
    return [data.path(f) for f in files]


def is_carried(subject):
    """Whether axis hints, tendons' paths and nails are given in the frame of the templates."""
    return dataset(subject).drawn_in == "template"


def carried_template(wildcards):
    """Input function: what was carried onto the subject's bones, where the subject needs it."""
    if not is_carried(wildcards.subject):
        return []
    return paths.at(paths.CARRIED_TEMPLATE, subject=wildcards.subject)


def carried_files(wildcards):
    """Input function: what is carried, and the templates of bones that carry it."""
    data = dataset(wildcards.subject)
    files = [b.template for b in data.bones.values() if b.template]
    files += [t.path for t in data.tendons.values()]
    files += [n.surface for n in data.nails.values()]
    return [data.path(f) for f in files]


def nail_files(subject):
    """The nails' patches: the generated folder, or the files that the dataset names; none that are carried."""
    data = dataset(subject)
    if is_carried(subject):
        return []
    if data.generator and generator(subject).truth is not None:
        return [data.path("templates")]
    return [data.path(nail.surface) for nail in data.nails.values()]


def curve_folder(subject, path):
    """A clicked curve: inside the generated folder, or a file of its own; none where it is carried."""
    data = dataset(subject)
    if is_carried(subject):
        return []
    return data.path("curves") if data.generator else data.path(path)


def scanned(subject):
    """Poses with a skin, of a scan or of their volume, other than neutral."""
    data = dataset(subject)
    return [n for n in data.poses if n != data.neutral and data.has_skin(n)]


def skin_of(subject, pose):
    """The skin of a pose that has one: its scan, aligned if in its own frame, else what its volume gives."""
    data = dataset(subject)
    if data.poses[pose].scan is None:
        return paths.at(paths.VOLUME_SKIN, subject=subject, pose=pose)
    if data.poses[pose].scan_frame == "own":
        return paths.at(paths.ALIGNED_SCAN, subject=subject, pose=pose)
    return data.path(data.poses[pose].scan)


def skins_from_volumes(wildcards):
    """Input function: figures of the skins that come from volumes."""
    data = dataset(wildcards.subject)
    bare = [p for p, pose in data.poses.items() if data.has_skin(p) and not pose.scan]
    return expand(paths.VOLUME_SKIN_FIGURES, subject=wildcards.subject, pose=bare)


def neutral_from_volume(wildcards):
    """Input function: figures of the neutral skin, where it comes from the volume."""
    data = dataset(wildcards.subject)
    if data.poses[data.neutral].scan or not data.has_skin(data.neutral):
        return []
    return in_neutral(paths.VOLUME_SKIN_FIGURES)(wildcards)


def neutral_skin(wildcards):
    """Input function: the neutral skin, which tells parts that touch in another pose apart."""
    subject = wildcards.subject
    if wildcards.pose == neutral(subject) or not dataset(subject).has_skin(
        neutral(subject)
    ):
        return []
    return skin_of(subject, neutral(subject))


def aligned_scans(subject):
    """Poses whose scan is aligned for the scenes: neutral's for any skin, the others' for fat."""
    data, layers = dataset(subject), scene_layers()
    needed_in = [data.neutral] if "skin" in layers else []
    needed_in = data.poses if "fat" in layers else needed_in
    own = [n for n in needed_in if data.poses[n].scan_frame == "own"]
    return [n for n in own if data.poses[n].scan]


def report_stages(subject):
    """The stages that the scenes ask for, by the names of their figures."""
    data, layers = dataset(subject), scene_layers()
    stages = ["seeds"] if proposed_poses(subject) else []
    stages += ["segmentation", "registration", "rig"]
    stages += ["tendons"] if "tendons" in layers and data.tendons else []
    stages += ["muscles"] if "muscles" in layers and data.muscles else []
    stages += [f"scan-{pose}" for pose in aligned_scans(subject)]
    stages += ["skin"] if "fat" in layers else []
    stages += ["poses"] if report_poses(subject) else []
    stages += ["images"] if poses_with_moved_images(subject) else []
    stages += ["deviations"] if states_deviations() else []
    stages += [f"frames-{name}" for name in SETTINGS.scenes]
    stages += [
        f"motion-{name}" for name in SETTINGS.scenes if is_motion(scene(name).frames)
    ]
    return stages


def report_tables(subject):
    """The tables of these stages that the report shows."""
    stages = [
        stage
        for stage in report_stages(subject)
        if stage in ("rig", "muscles", "skin", "poses") or stage.startswith("frames-")
    ]
    return expand(paths.TABLE, subject=subject, stage=stages)


def poses_in_report(subject):
    """Simulated scanned poses that the report draws: those that other stages need, too."""
    data, layers = dataset(subject), scene_layers()
    if "fat" in layers:
        return [data.neutral, *scanned(subject)]
    if "muscles" in layers and data.muscles:
        return data.poses_of(Role.example, Role.heldout)
    return []


def report_poses(subject):
    """The files of these poses."""
    if "fat" in scene_layers():
        poses = poses_in_report(subject)
        return expand([paths.POSE_INNER, paths.POSE_SKIN], subject=subject, pose=poses)
    return muscle_poses(subject) if poses_in_report(subject) else []


def fat_fits(subject):
    """The fits of the fat's strains to scans, where a scene needs them."""
    poses = dataset(subject).examples if "fat" in scene_layers() else []
    return expand(paths.FAT_FIT, subject=subject, pose=poses)


def volumes(subject, poses):
    """The images of poses."""
    data = dataset(subject)
    return [data.path(data.poses[pose].volume) for pose in poses]


def scans(subject, poses):
    """The scans of those poses that have one; what volumes give, too, where the fat is fitted to it."""
    data, fat = dataset(subject), "fat" in scene_layers()
    has = data.has_skin if fat else lambda pose: data.poses[pose].scan is not None
    return [skin_of(subject, p) for p in poses if has(p)]


def scanned_files(subject):
    """What a person would have of a subject: images, scans, and seeds where a pose has its own."""
    data = dataset(subject)
    seeds = [data.path(pose.seeds) for pose in data.poses.values() if pose.seeds]
    return [*volumes(subject, data.poses), *scans(subject, data.poses), *seeds]


def neutral_volume(wildcards):
    data = dataset(wildcards.subject)
    return data.path(data.poses[data.neutral].volume)


def neutral_scan(wildcards):
    data = dataset(wildcards.subject)
    return needed_scan(wildcards.subject, data.neutral, "skin")


def example_scan(wildcards):
    return needed_scan(wildcards.subject, wildcards.pose, "fat")


def needed_scan(subject, pose, layer):
    """A pose's skin that a layer is made of; where there is none the build ends before it begins."""
    if len(dataset(subject).bones) < len(whole_dataset(subject).bones):
        raise WorkflowError(
            f"handpipe: {', '.join(SETTINGS.scenes)}: only: {layer} is made of the skin around all bones. "
            "Remove `only` from the scenes, or build another target"
        )
    checked(require_skin, dataset_file(subject), dataset(subject), pose, layer)
    return skin_of(subject, pose)


def of_muscles(pattern):
    """Input function: a pattern over the subject's muscles."""
    return lambda w: expand(
        pattern, muscle=dataset(w.subject).muscles, allow_missing=True
    )


def of_muscle(field):
    """Input function: hand-placed markers or landmarks of one muscle in neutral, where the dataset has them."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        path = getattr(data.poses[data.neutral], field).get(wildcards.muscle)
        return [] if path is None else data.path(path)

    return files


def labels_of_muscle(wildcards):
    """Input function: the label map of neutral, where it holds the muscle."""
    data = dataset(wildcards.subject)
    held = in_label_map(wildcards.subject, data.neutral)
    return (
        data.path(data.poses[data.neutral].labels) if wildcards.muscle in held else []
    )


def labels_of_examples(wildcards):
    """Input function: the label maps of the example poses, in their order."""
    data = dataset(wildcards.subject)
    maps = [data.poses[pose].labels for pose in data.examples]
    return [data.path(file) for file in maps if file is not None]


def all_of_muscles(field):
    """Input function: the same of all muscles in the example poses."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        return [
            data.path(path)
            for pose in data.examples
            for path in getattr(data.poses[pose], field).values()
        ]

    return files


def painted_regions(subject, fascia):
    """Regions that a person painted on a fascia, in place of those found from geometry."""
    data = dataset(subject)
    return data.path(data.regions[fascia]) if fascia in data.regions else []


def template_hands():
    """Right hands of the configuration whose generator has the bones and skin that the file is made for."""
    return [
        subject
        for subject in buildable_subjects()
        if generator(subject)
        and generator(subject).template
        and dataset(subject).hand == "right"
    ]


def has_organs(subject):
    """Whether the subject has organs, which are fitted in every pose."""
    data = dataset(subject)
    return bool(data.tendons or data.muscles or data.ligaments)


def as_built(subject, name):
    """What a benchmark reads of a built subject to simulate the layers of a scene."""
    data, file = (
        checked(load_dataset, dataset_file(subject)),
        f"config/scenes/{name}.yaml",
    )
    layers = artifacts_of(checked(load_scene, file).needed, data)
    built = [paths.RIG, *(f"{paths.SUBJECT}/{path}" for path in layers)]
    return [dataset_file(subject), file, *expand(built, subject=subject)]


def simulated_frames(subject, name):
    """The frames of a scene, and what a benchmark reads to simulate some of them again."""
    numbers = chunks(subject, name)
    made = expand(paths.SCENE_CHUNK, subject=subject, scene=name, chunk=numbers)
    return [*made, *as_built(subject, name)]


def levels_against_truth(subject):
    """What the benchmark of levels reads of scanned poses: truth, simulated skin and layers under it."""
    data = whole_dataset(subject)
    poses = [pose for pose in data.poses if pose != data.neutral]
    patterns = [paths.POSE_INNER, paths.POSE_SKIN]
    made = expand(patterns, subject=subject, pose=poses)
    return [*made, *expand(paths.TRUTH, subject=subject, pose=data.poses)]


def compared_with_truth(subject):
    """What a benchmark reads of a built subject to compare it, and its raw scans, with the truth."""
    data = checked(load_dataset, dataset_file(subject))
    of_poses = [
        *(paths.DATA_VOLUME, paths.DATA_SEEDS, paths.DATA_SCAN, paths.TRUTH),
        *(paths.TRUE_BONES, paths.TRUE_MARROW, paths.REGISTRATION),
    ]
    if data.fleshed:
        of_poses.append(paths.POSE_FLESH)
    files = [*of_poses, paths.RIG, paths.HOOKS, paths.metrics_of("skin")]
    return [
        dataset_file(subject),
        *expand(files, subject=subject, pose=data.poses, tendon=data.tendons),
    ]


def creases_beside_models(subject):
    """What the benchmark of level L3 reads of a built subject."""
    files = [paths.RIG, paths.SKIN, paths.CREASE_TISSUE, paths.POSE_SKIN, paths.TRUTH]
    return [
        dataset_file(subject),
        *expand(files, subject=subject, pose=scanned(subject)),
    ]


CODE = CodeDigests(
    packages=(Path(handpipe.__file__).parent, Path("benchmarks").absolute()),
    cache=Path(handpipe.__file__).parent / "__pycache__" / "code_digests.json",
)
atexit.register(CODE.save)
SCRIPTS = Path(workflow.basedir) / "workflow" / "scripts"
LAYER_LOADING = Path(layer_loading.__file__)
# The layers that rules load by their records, which name the code that no import shows.
LOADED_LAYERS = {
    "simulate": lambda w: scene(w.scene).needed,
    "simulate_inner": lambda w: layers_in(w.inner),
    "simulate_flesh": lambda w: ["bones", "flesh"],
    "simulate_ablated_inner": lambda w: VARIANTS[w.variant].loaded,
}


def layer_code(each, wildcards, *files):
    """The modules of the layers that a rule's script loads: those that its job names, else all."""
    if LAYER_LOADING not in CODE.modules(files):
        return []
    layers = LOADED_LAYERS.get(each.name, lambda w: LAYERS)(wildcards)
    return [CODE.module(LAYERS[layer].module) for layer in layers]


def code_of(each):
    """Parameter function: a digest of the code that a rule's script runs."""
    script = SCRIPTS / Path(each.script).name
    if each.name.startswith("benchmark_"):
        name = next(v for k, v in each.params._allitems() if k == "name")
        further = sorted(Path("benchmarks", name).absolute().glob("*.py"))
        return lambda w: CODE.digest(
            script, *further, *layer_code(each, w, script, *further)
        )
    if each.name in ("generate_templates", "generate_pose", "generate_bones"):
        return lambda w: CODE.digest(script, CODE.module(generator(w.subject).module))
    return lambda w: CODE.digest(script, *layer_code(each, w, script))


def depend_on_code():
    """Give every rule the digest of its code and the names of its files as parameters.

    A change of the library reruns what imports it. Without the names, two jobs of one rule that read the same
    files would be one job to Snakemake's cache between workflows, which looks at parameters, not at wildcards.
    """
    for each in workflow.rules:
        if each.script:
            each.set_params(code=code_of(each), made=lambda w, output: [*output])


# Long jobs with one file. A rule that reads several files of one kind that a person gives, as extract_muscle_shapes
# does, is none of them: Snakemake's key tells the contents of such files, not which of them is which.
WORTH_SHARING = (
    "coupled_pose",
    "sliding_pose",
    "segment_pose",
    "register_bones",
    "register_tendon",
    "extract_muscle",
    "separate_neutral",
    "separate_muscles",
    "fit_muscle_strains",
    "fit_fat_strains",
)


def share_between_workflows():
    """With --cache, keep the files of long jobs for all workflows, in $SNAKEMAKE_OUTPUT_CACHE.

    The directive `cache` would warn in every other call, and Snakemake refuses it beside `benchmark`: a file from
    the cache has no cost.
    """
    if workflow.enable_cache:
        for each in workflow.rules:
            if each.name in WORTH_SHARING:
                each.cache.flag |= CacheFlag.output
                each._benchmark = None
