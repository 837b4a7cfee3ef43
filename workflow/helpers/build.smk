# A build as a whole: its lock, costs of jobs, what a change of code reruns, what workflows share.

import atexit
import fcntl
import math
from pathlib import Path

import handpipe
from snakemake.caching.rule import CacheFlag
from snakemake.exceptions import WorkflowError

from handpipe.core import LAYERS, CodeDigests, paths
from handpipe.core.configuration import EDGES
from handpipe.hand import layer_loading
from handpipe.stages.baselines.variants import VARIANTS

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


def at_size(mesh, preview, paper, like=None):
    """What jobs ask for at the edge length of a mesh: a power of it through what they ask for at two fidelities.

    like: the mesh whose lengths at these two count, where the own length is the same at both.
    """
    coarse, fine = (getattr(EDGES[word], like or mesh) for word in ("preview", "paper"))
    edge = getattr(SETTINGS.sizes, mesh)
    share = math.log(coarse / edge) / math.log(coarse / fine)
    return math.ceil(preview * (paper / preview) ** max(share, 0))


def costs_of(*rules):
    """Parameter function: the folders of the benchmark files of some rules' jobs.

    They are no inputs: figures tell what jobs took where that is known, and no result depends on them.
    """
    return lambda w: [
        str(paths.at(paths.costs_of(rule), subject=w.subject)) for rule in rules
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
