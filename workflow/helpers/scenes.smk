# Scenes by name: their layers, the files of these, their frames and chunks.

import functools
import re
from pathlib import Path

from snakemake.exceptions import WorkflowError

from handpipe.core import (
    LAYERS,
    HandpipeError,
    artifacts_of,
    inner_layers,
    needed,
    paths,
)
from handpipe.core.configuration import Role, load_scene, require_fidelity
from handpipe.hand import failures_in, joint_limits, require_plain
from handpipe.levels import require_learned
from handpipe.skeleton.drivers import frame_names
from handpipe.skeleton.motion import is_motion, is_random_file, motion_frame_names

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


def chunk_before(wildcards):
    """The chunk whose last frame the first one follows, in scenes whose frames follow one another."""
    number = int(wildcards.chunk)
    if number == 0 or not scene(wildcards.scene).follow:
        return []
    return paths.at(paths.SCENE_CHUNK, **{**wildcards, "chunk": number - 1})


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
        paths.SCENE_SCAN: lambda s: s.scan,
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
