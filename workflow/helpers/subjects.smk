# Which subjects there are, and what makes each.

import functools
from pathlib import Path

from snakemake.exceptions import WorkflowError

from handpipe.core import HandpipeError, paths
from handpipe.core.configuration import load_dataset, load_scene, settings_of
from handpipe.hand import named_files, part_of, require_files
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
        raise WorkflowError(
            "handpipe: scenes: the recording of every scene is absent; name a scene whose files are here"
        )
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
    """The dataset of a file, which is read once."""
    return load_dataset(file)


def dataset_file(subject):
    return f"config/datasets/{subject}.yaml"


@functools.cache
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
    if SETTINGS.subjects and not kept:
        raise WorkflowError(
            "handpipe: subjects: the anatomy of every subject is absent; name a subject whose files are here"
        )
    return kept


@functools.cache
def right_datasets():
    """Datasets by subject, of all files that are right: a mistake in one is the matter of its own subject."""
    found = {}
    for file in sorted(Path("config/datasets").glob("*.yaml")):
        try:
            found[file.stem] = read_dataset(file)
        except HandpipeError as error:
            if file.stem not in SETTINGS.subjects:  # of these `whole_dataset` says it
                logger.warning(f"handpipe: {file.stem} has no rules: {error}")
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


def template_hands():
    """Right hands of the configuration whose generator has the bones and skin that the file is made for."""
    return [
        subject
        for subject in buildable_subjects()
        if generator(subject)
        and generator(subject).template
        and dataset(subject).hand == "right"
    ]
