"""Where every file of a build is: patterns below the folder of the project, with wildcards in braces.

Rules take the patterns as they are; `at` gives the path of one file.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

RESULTS = "results"
SUBJECT = f"{RESULTS}/{{subject}}"

# What a generated subject is made of.
TEMPLATE = f"{SUBJECT}/anatomy/template.h5"
TEMPLATE_SUBJECT = f"{SUBJECT}/anatomy/subject.h5"
COUPLED_BODY = f"{SUBJECT}/anatomy/coupled.h5"
COUPLED_POSE = f"{SUBJECT}/coupled/{{pose}}.h5"

# A generated subject's data: what a scanner and a person would give, and the truth.
DATA_TEMPLATES = f"{SUBJECT}/data/templates"
DATA_CURVES = f"{SUBJECT}/data/curves"
DATA_VOLUME = f"{SUBJECT}/data/volumes/{{pose}}.nii.gz"
DATA_SEEDS = f"{SUBJECT}/data/seeds/{{pose}}.nii.gz"
DATA_SCAN = f"{SUBJECT}/data/scans/{{pose}}.ply"
TRUTH = f"{SUBJECT}/data/truth/{{pose}}.h5"
TRUE_BONES = f"{SUBJECT}/data/truth/{{pose}}.bones.nii.gz"
TRUE_MARROW = f"{SUBJECT}/data/truth/{{pose}}.marrow.nii.gz"

# A scanned subject's data are where its dataset says.
CHECK = f"{SUBJECT}/check.json"

# Fat and water of a pose with Dixon echoes.
WATER_IMAGE = f"{SUBJECT}/images/{{pose}}/water.nii.gz"
FAT_IMAGE = f"{SUBJECT}/images/{{pose}}/fat.nii.gz"
FIELD_MAP = f"{SUBJECT}/images/{{pose}}/field.nii.gz"
FAT_WATER = f"{SUBJECT}/images/{{pose}}/fat_water.json"

# Images to bones.
SEEDS = f"{SUBJECT}/segmentation/{{pose}}/seeds.nii.gz"
SEEDS_CONFIDENCE = f"{SUBJECT}/segmentation/{{pose}}/seeds.json"
LOCATED = f"{SUBJECT}/segmentation/{{pose}}/located.h5"
SEGMENTED = f"{SUBJECT}/segmentation/{{pose}}/bones.h5"
CORRECTED = f"{SUBJECT}/segmentation/{{pose}}/corrected/{{bone}}.h5"
LABELS = f"{SUBJECT}/segmentation/{{pose}}/labels.nii.gz"
LABEL_TABLE = f"{SUBJECT}/segmentation/{{pose}}/labels.json"
BONE_SURFACES = f"{SUBJECT}/segmentation/{{pose}}/surfaces.h5"
VOLUME_SKIN = f"{SUBJECT}/segmentation/{{pose}}/skin.ply"
VOLUME_SKIN_FIGURES = f"{SUBJECT}/segmentation/{{pose}}/skin.json"
LOOKS = f"{SUBJECT}/segmentation/{{pose}}/looks.json"

# The skeleton.
REGISTRATION = f"{SUBJECT}/registration/{{pose}}.h5"
RIG = f"{SUBJECT}/rig.h5"
CARRIED_TEMPLATE = f"{SUBJECT}/carried_template.h5"

# Scans that are given in their own frame.
ALIGNED_SCAN = f"{SUBJECT}/scans/{{pose}}/aligned.ply"

# Tendons, muscles, ligaments.
NEUTRAL_TENDON = f"{SUBJECT}/tendons/{{tendon}}/neutral.h5"
POSED_TENDON = f"{SUBJECT}/tendons/{{tendon}}/poses/{{pose}}.h5"
HOOKS = f"{SUBJECT}/tendons/{{tendon}}/hooks.h5"
PLACED_TEMPLATES = f"{SUBJECT}/templates.h5"
FITTED_MUSCLE = f"{SUBJECT}/muscles/{{muscle}}/fitted.h5"
NEUTRAL_MUSCLES = f"{SUBJECT}/muscles/neutral.h5"
MUSCLE_SHAPES = f"{SUBJECT}/muscles/shapes.h5"
SEPARATED_MUSCLES = f"{SUBJECT}/muscle_separation/{{pose}}.h5"
MUSCLE_STRAINS = f"{SUBJECT}/muscles/{{muscle}}/strains.h5"
LIGAMENT = f"{SUBJECT}/ligaments/{{ligament}}.h5"

# Fascia, skin, fat.
BONE_FASCIA = f"{SUBJECT}/fascia/bone.h5"
MUSCLE_FASCIA = f"{SUBJECT}/fascia/muscle.h5"
SKIN = f"{SUBJECT}/skin.h5"
FLESH = f"{SUBJECT}/flesh.h5"
SOFT_TISSUE = f"{SUBJECT}/soft_tissue/mesh.h5"
CREASE_TISSUE = f"{SUBJECT}/soft_tissue/creases.h5"  # of level L3
SOFT_TISSUE_FIT = f"{SUBJECT}/soft_tissue/poses/{{pose}}.h5"
SOFT_TISSUE_STRAINS = f"{SUBJECT}/soft_tissue/strains.h5"
FAT = f"{SUBJECT}/fat/mesh.h5"
FAT_FIT = f"{SUBJECT}/fat/poses/{{pose}}.h5"
FAT_STRAINS = f"{SUBJECT}/fat/strains.h5"

# Simulated scanned poses. The name of layers under the fat is "inner", or "inner-" with the layers.
POSE_LAYERS = f"{SUBJECT}/poses/{{pose}}/{{inner}}.h5"
POSE_FLESH = f"{SUBJECT}/poses/{{pose}}/flesh.h5"
POSE_INNER = f"{SUBJECT}/poses/{{pose}}/inner.h5"
POSE_SKIN = f"{SUBJECT}/poses/{{pose}}/skin.h5"
POSE_PASSIVE_SKIN = f"{SUBJECT}/poses/{{pose}}/passive_skin.h5"
POSE_BASELINES = f"{SUBJECT}/poses/{{pose}}/baselines.h5"
MOVED_IMAGE = f"{SUBJECT}/poses/{{pose}}/moved.nii.gz"
MOVED_SLICES = f"{SUBJECT}/poses/{{pose}}/moved.png"
MOVED_FIGURES = f"{SUBJECT}/poses/{{pose}}/moved.json"

# How far the hand is expected to be off, learned from its fits.
DEVIATIONS = f"{SUBJECT}/deviations.h5"
# The full model with one part left out or replaced (`handpipe.stages.baselines.variants`).
ABLATION = f"{SUBJECT}/ablations/{{variant}}"

# Simulated scenes.
SIMULATION = f"{SUBJECT}/simulation"
SCENE_CHUNKS = "*/frames-*.h5"  # of all scenes below SIMULATION, to look for
SCENE_CHUNK = f"{SIMULATION}/{{scene}}/frames-{{chunk}}.h5"
SCENE_EQUILIBRIA = f"{SIMULATION}/{{scene}}/equilibria-{{chunk}}.json"
SCENE_ANGLES = f"{SIMULATION}/{{scene}}/angles.csv"  # of a motion
SCENE_LEVELS = f"{SIMULATION}/{{scene}}/levels.h5"  # learned from its frames
SCENE_PORTABLE = f"{SIMULATION}/{{scene}}/levels.npz"  # the same for other programs
SCENE_PLAYER = f"{SIMULATION}/{{scene}}/player.html"  # a page that plays it
SCENE_SHARD = f"{SIMULATION}/{{scene}}/shards/shard-{{chunk}}.npz"  # of its training set
SCENE_SHARD_BODIES = f"{SIMULATION}/{{scene}}/shards/bodies.npz"  # what its frames share
SCENE_SHARD_INDEX = f"{SIMULATION}/{{scene}}/shards/index.json"
SCENE_GLB = f"{SIMULATION}/{{scene}}/{{scene}}.glb"
SCENE_VTK = f"{SIMULATION}/{{scene}}/vtk"
SCENE_OBJ = f"{SIMULATION}/{{scene}}/obj"
SCENE_RIGGED = f"{SIMULATION}/{{scene}}/{{scene}}-rigged.glb"
SCENE_SCAN = f"{SIMULATION}/{{scene}}/{{scene}}-scan.glb"
SCENE_MECHANICS = f"{SIMULATION}/{{scene}}/mechanics"
SCENE_DEVIATIONS = f"{SIMULATION}/{{scene}}/deviations"
SCENE_STATED = f"{SIMULATION}/{{scene}}/deviations.h5"
SCENE_SKELETON = f"{SIMULATION}/{{scene}}/skeleton"  # for MuJoCo and OpenSim
SCENE_MOVIE = f"{SIMULATION}/{{scene}}/{{scene}}.webp"
SCENE_ANATOMY_MOVIE = f"{SIMULATION}/{{scene}}/{{scene}}-anatomy.webp"
SCENE_FAT_MOVIE = f"{SIMULATION}/{{scene}}/{{scene}}-fat.webp"
SCENE_IMAGES = f"{SIMULATION}/{{scene}}/images"
SIMULATION_COMPLETE = f"{SIMULATION}/complete.json"

# Figures of the stages, tables of the report, and the report.
METRICS = f"{SUBJECT}/metrics/{{stage}}.json"
TABLE = f"{SUBJECT}/tables/{{stage}}.json"
SKIN_ARRAY = f"{SUBJECT}/tables/skin.nc"
REPORT = f"{SUBJECT}/report.html"
PICTURES = f"{SUBJECT}/pictures"
COMPLETE = f"{SUBJECT}/complete.json"

# What Snakemake measured of the jobs, and what they logged.
COSTS = f"{SUBJECT}/benchmarks"
LOGS = f"{SUBJECT}/logs"

# Benchmarks of the code, of no subject.
BENCHMARKS = f"{RESULTS}/benchmarks"


def at(pattern: str, **wildcards: object) -> Path:
    """Path of the file of a pattern for the given wildcards.

    Parameters
    ----------
    pattern : str
        Pattern with wildcards in braces.
    **wildcards : object
        Value of each wildcard of the pattern, by its name.

    Returns
    -------
    path
        Below the folder of the project.

    Raises
    ------
    KeyError
        For a wildcard of the pattern that is not given.
    """
    return Path(pattern.format(**wildcards))


def partial_chunk(chunk: str | Path) -> Path:
    """Where the finished frames of a chunk are stored while others are missing."""
    return Path(chunk).with_name(Path(chunk).name.replace("frames-", "partial-", 1))


def below(pattern: str, **names: str) -> str:
    """The path of a subject's file below the subject's folder, with its wildcards filled in."""
    return pattern.removeprefix(SUBJECT + "/").format(**names)


def ablated(pattern: str) -> str:
    """Pattern of a variant's own file in place of the full model's: in the folder of the variant."""
    return pattern.replace(SUBJECT, ABLATION, 1)


def metrics_of(stage: str) -> str:
    """Pattern of the figures of a stage; the stage may hold wildcards."""
    return METRICS.replace("{stage}", stage)


def table_of(stage: str) -> str:
    """Pattern of the table of a stage; the stage may hold wildcards."""
    return TABLE.replace("{stage}", stage)


def log_of(rule: str, *wildcards: str) -> str:
    """Pattern of the logs of a rule: one for each value of the wildcards, or "all"."""
    return f"{LOGS}/{rule}/{_name(wildcards)}.log"


def costs_of(rule: str) -> str:
    """Pattern of the folder of Snakemake's benchmark files of a rule."""
    return f"{COSTS}/{rule}"


def cost_of(rule: str, *wildcards: str) -> str:
    """Pattern of Snakemake's benchmark files of a rule, named as its logs."""
    return f"{costs_of(rule)}/{_name(wildcards)}.tsv"


def benchmark_of(name: str) -> str:
    """Pattern of a benchmark's result with its ending, as "fem.json"."""
    return f"{BENCHMARKS}/{name}"


def _name(wildcards: Sequence[str]) -> str:
    return "/".join(f"{{{wildcard}}}" for wildcard in wildcards) or "all"
