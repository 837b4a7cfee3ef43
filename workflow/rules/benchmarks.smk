# What is timed, and against what; asked for by name: snakemake -j1 benchmark_fem, benchmark_bones, …

SEEDED = "config/datasets/phantom-hand-seeded.yaml"
BENCHMARK_POSES = ["neutral", "fist"]  # of the walkers' regions
ALIGNED = [
    "neutral",
    "bow",
    "fist",
    "spread",
    "curl",
    "half",
]  # of the finger, for scans in a frame of their own


rule benchmark_fem:
    output:
        paths.benchmark_of("fem.json"),
    log:
        paths.benchmark_of("logs/benchmark_fem.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_fem.tsv")
    threads: 2
    resources:
        mem_mb=8000,
        runtime=180,
    params:
        name="fem",
        arguments=[],
    message:
        "benchmarks of the equilibrium solver; nothing else should run meanwhile"
    script:
        "../scripts/benchmark.py"


rule benchmark_bones:
    input:
        dataset_file("phantom-hand"),
    output:
        paths.benchmark_of("bones.json"),
    log:
        paths.benchmark_of("logs/benchmark_bones.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_bones.tsv")
    threads: 1
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        name="bones",
        arguments=[],
    message:
        "hard cases of the bones and their speed against error; nothing else should run meanwhile"
    script:
        "../scripts/benchmark.py"


rule benchmark_shapes:
    output:
        paths.benchmark_of("shapes.json"),
    log:
        paths.benchmark_of("logs/benchmark_shapes.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_shapes.tsv")
    threads: 2
    resources:
        mem_mb=12000,
        runtime=120,
    params:
        name="shapes",
        arguments=[],
    message:
        "benchmarks of shapes from plastic strains; nothing else should run meanwhile"
    script:
        "../scripts/benchmark.py"


rule benchmark_segmentation:
    input:
        dataset=SEEDED,
        files=expand(
            [paths.DATA_VOLUME, paths.DATA_SEEDS, paths.TRUE_MARROW],
            subject="phantom-hand-seeded",
            pose=BENCHMARK_POSES,
        ),
    output:
        paths.benchmark_of("segmentation.json"),
    log:
        paths.benchmark_of("logs/benchmark_segmentation.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_segmentation.tsv")
    threads: 1
    resources:
        mem_mb=6000,
        runtime=30,
    params:
        name="segmentation",
        arguments=[SEEDED, "--poses", *BENCHMARK_POSES],
    message:
        "the random walker against scikit-image's; nothing else should run meanwhile"
    script:
        "../scripts/benchmark.py"


rule benchmark_truth:
    output:
        paths.benchmark_of("truth.json"),
        paths.benchmark_of("truth-refinement.json"),
        paths.benchmark_of("truth-toy.png"),
        paths.benchmark_of("truth-convergence.png"),
    log:
        paths.benchmark_of("logs/benchmark_truth.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_truth.tsv")
    threads: 1
    resources:
        mem_mb=6000,
        runtime=30,
    params:
        name="truth",
        arguments=[],
    message:
        "checks of the coupled truth by itself, on a toy finger"
    script:
        "../scripts/benchmark.py"


rule benchmark_anatomy:
    output:
        paths.benchmark_of("anatomy.json"),
    log:
        paths.benchmark_of("logs/benchmark_anatomy.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_anatomy.tsv")
    threads: 1
    resources:
        mem_mb=6000,
        runtime=30,
    params:
        name="anatomy",
        arguments=["../shared/data"],
    message:
        "upper envelopes, edits of curves; a real hand's template carried to another by feature points"
    script:
        "../scripts/benchmark.py"


SCANS = {  # parts of the benchmark of scans, modules of benchmarks.scans: what each needs to be built
    "foot": ["tests/data/foot-strokes.json"],
    "knee": [
        dataset_file("knee"),
        *expand("tests/data/knee/strokes-{n}.json", n=["first", "second"]),
    ],
    "skin": [dataset_file("phantom-finger")],
    "alignment": expand(
        [paths.metrics_of("rig"), paths.RIG, paths.DATA_VOLUME],
        subject="phantom-finger",
        pose=ALIGNED,
    ),
    "effects": [],
    "chain": [dataset_file("phantom-finger")],
    "from_raw": lambda w: compared_with_truth("phantom-finger"),
}


rule benchmark_scans_part:
    input:
        lambda w: SCANS[w.part](w) if callable(SCANS[w.part]) else SCANS[w.part],
    output:
        paths.benchmark_of("scans/{part}.json"),
    log:
        paths.benchmark_of("logs/benchmark_scans_part/{part}.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_scans_part/{part}.tsv")
    wildcard_constraints:
        part="|".join(SCANS),
    threads: 1
    resources:
        mem_mb=4000,
        runtime=60,
    params:
        name="scans",
        arguments=lambda w: [w.part],
    message:
        "what comes of real scans, without a truth: {wildcards.part}"
    script:
        "../scripts/benchmark.py"


rule benchmark_scans:
    input:
        expand(paths.benchmark_of("scans/{part}.json"), part=SCANS),
    output:
        paths.benchmark_of("scans.json"),
    log:
        paths.benchmark_of("logs/benchmark_scans.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_scans.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="scans",
        arguments=lambda w, input: ["merge", *input],
    message:
        "what comes of real scans: all figures"
    script:
        "../scripts/benchmark.py"


TRUSTED = "phantom-hand-preview"
FRAMES = paths.benchmark_of("trust/frames/{chunk}.npz")
CHUNKS = [  # of frames, as benchmarks/trust/poses.py numbers them
    f"{kind}{i}"
    for kind, chunks in {"inside": 6, "outside": 6, "path": 5}.items()
    for i in range(chunks)
]
TRUST = {  # parts of the benchmark of trust: what each needs to be built
    "solver": [],
    "frames": [
        *expand(FRAMES, chunk=CHUNKS),
        dataset_file(TRUSTED),
        *expand(paths.RIG, subject=TRUSTED),
    ],
    "seeds": [
        dataset_file(TRUSTED),
        *expand(paths.metrics_of("segmentation"), subject=TRUSTED),
        *expand(
            [paths.DATA_VOLUME, paths.TRUE_BONES, paths.TRUE_MARROW],
            subject=TRUSTED,
            pose="neutral",
        ),
    ],
    "readers": [],
    "stale": [],
    "kills": [],
}


rule benchmark_trust_frames:
    input:
        expand(paths.metrics_of("skin"), subject=TRUSTED),
        lambda w: as_built(TRUSTED, "hand-preview"),
    output:
        FRAMES,
    log:
        paths.benchmark_of("logs/benchmark_trust_frames/{chunk}.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_trust_frames/{chunk}.tsv")
    wildcard_constraints:
        chunk="|".join(CHUNKS),
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        name="trust.chunk",
        arguments=lambda w: [w.chunk],
    message:
        "frames of the embedded hand for the benchmark of trust: {wildcards.chunk}"
    script:
        "../scripts/benchmark.py"


rule benchmark_trust_part:
    input:
        lambda w: TRUST[w.part],
    output:
        paths.benchmark_of("trust/{part}.json"),
    log:
        paths.benchmark_of("logs/benchmark_trust_part/{part}.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_trust_part/{part}.tsv")
    wildcard_constraints:
        part="|".join(TRUST),
    threads: 1
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        name="trust",
        arguments=lambda w: [w.part],
    message:
        "whether wrong results are refused: {wildcards.part}"
    script:
        "../scripts/benchmark.py"


rule benchmark_trust:
    input:
        expand(paths.benchmark_of("trust/{part}.json"), part=TRUST),
    output:
        paths.benchmark_of("trust.json"),
    log:
        paths.benchmark_of("logs/benchmark_trust.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_trust.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="trust",
        arguments=lambda w, input: ["merge", *input],
    message:
        "whether wrong results are refused: all figures"
    script:
        "../scripts/benchmark.py"


FIDELITIES = ["preview", "standard", "paper-fat", "paper"]


# A build in a folder of its own; called again it goes on where it was stopped.
rule benchmark_fidelity_part:
    input:
        paths.at(paths.RIG, subject="phantom-finger"),
    output:
        paths.benchmark_of("fidelity/{part}.json"),
    log:
        paths.benchmark_of("logs/benchmark_fidelity_part/{part}.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_fidelity_part/{part}.tsv")
    wildcard_constraints:
        part="|".join(FIDELITIES),
    threads: 1
    resources:
        mem_mb=6000,
        runtime=600,
    params:
        name="fidelity",
        arguments=lambda w: [w.part],
    message:
        "the finger at {wildcards.part}: errors and seconds"
    script:
        "../scripts/benchmark.py"


rule benchmark_fidelity_figures:
    input:
        expand(paths.benchmark_of("fidelity/{part}.json"), part=FIDELITIES),
    output:
        paths.benchmark_of("fidelity.json"),
    log:
        paths.benchmark_of("logs/benchmark_fidelity_figures.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_fidelity_figures.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="fidelity",
        arguments=lambda w, input: ["merge", *input],
    message:
        "speed of the chain against its error: all figures"
    script:
        "../scripts/benchmark.py"


rule benchmark_fidelity:
    input:
        paths.benchmark_of("fidelity.json"),
    output:
        paths.benchmark_of("fidelity.png"),
        paths.benchmark_of("fidelity.md"),
    log:
        paths.benchmark_of("logs/benchmark_fidelity.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_fidelity.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="fidelity.document",
        arguments=lambda w, input: [*input],
    message:
        "speed of the chain against its error: picture and table"
    script:
        "../scripts/benchmark.py"


LAYERED = ["cases", "random"]
MOVED = "phantom-hand-preview"  # whose sequences are timed


rule benchmark_layered_part:
    input:
        expand(paths.metrics_of("skin"), subject="phantom-finger"),
        lambda w: as_built("phantom-finger", "flexion"),
    output:
        paths.benchmark_of("layered/{part}.json"),
        paths.benchmark_of("layered/{part}.csv"),
    log:
        paths.benchmark_of("logs/benchmark_layered_part/{part}.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_layered_part/{part}.tsv")
    wildcard_constraints:
        part="|".join(LAYERED),
    threads: 1
    resources:
        mem_mb=4000,
        runtime=120,
    params:
        name="layered",
        arguments=lambda w: [w.part],
    message:
        "hard cases of the layered simulation: {wildcards.part}"
    script:
        "../scripts/benchmark.py"


rule benchmark_layered:
    input:
        expand(paths.benchmark_of("layered/{part}.json"), part=LAYERED),
    output:
        paths.benchmark_of("layered.json"),
    log:
        paths.benchmark_of("logs/benchmark_layered.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_layered.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="layered",
        arguments=lambda w, input: ["merge", *input],
    message:
        "hard cases of the layered simulation: all figures"
    script:
        "../scripts/benchmark.py"


# The five sequences of Zheng 2022 Table 3 on the generated hand: some thousands of frames, hours on two cores.
rule benchmark_motions:
    input:
        metrics=lambda w: figures_of_frames(MOVED, paths.metrics_of),
        tables=lambda w: figures_of_frames(MOVED, paths.table_of),
    output:
        paths.benchmark_of("frames.json"),
        paths.benchmark_of("frames.md"),
    log:
        paths.benchmark_of("logs/benchmark_motions.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_motions.tsv")
    threads: 1
    resources:
        mem_mb=1000,
        runtime=5,
    params:
        name="motions",
        arguments=lambda w: [
            paths.at(paths.SUBJECT, subject=MOVED),
            "--scenes",
            *shipped_sequences(),
        ],
    message:
        "the five sequences: frames, seconds, contact and continuity"
    script:
        "../scripts/benchmark.py"


# Of lengths that were measured before, kept in benchmarks/cluster; nothing is built.
rule benchmark_cluster:
    input:
        measured="benchmarks/cluster/measured.json",
        profile="profiles/slurm/config.yaml",
    output:
        paths.benchmark_of("cluster.json"),
        paths.benchmark_of("cluster.md"),
        paths.benchmark_of("cluster.svg"),
    log:
        paths.benchmark_of("logs/benchmark_cluster.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_cluster.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="cluster",
        arguments=lambda w, input: ["--measured", input.measured],
    message:
        "the jobs of the hand and of sequences on 1 to 1,000 workers, simulated"
    script:
        "../scripts/benchmark.py"


LEVELS = {  # parts of the benchmark of levels: subject, and scene of random poses
    "finger": ("phantom-finger", "random-finger"),
    "hand": ("phantom-hand-preview", "random-hand"),
}


rule benchmark_levels_part:
    input:
        lambda w: simulated_frames(*LEVELS[w.part]),
        truth=lambda w: levels_against_truth(LEVELS[w.part][0]),
        skin=lambda w: paths.at(paths.SKIN, subject=LEVELS[w.part][0]),
        driven="config/scenes/typing.csv",
    output:
        paths.benchmark_of("levels/{part}.json"),
    log:
        paths.benchmark_of("logs/benchmark_levels_part/{part}.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_levels_part/{part}.tsv")
    wildcard_constraints:
        part="|".join(LEVELS),
    threads: 1
    resources:
        mem_mb=6000,
        runtime=60,
    params:
        name="levels",
        arguments=lambda w: [w.part],
    message:
        "levels below the simulation: {wildcards.part}; nothing else should run meanwhile"
    script:
        "../scripts/benchmark.py"


rule benchmark_levels_creases:
    input:
        lambda w: creases_beside_models("phantom-finger"),
    output:
        paths.benchmark_of("levels/creases.json"),
    log:
        paths.benchmark_of("logs/benchmark_levels_creases.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_levels_creases.tsv")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        name="levels",
        arguments=["creases"],
    message:
        "level L3 in the finger's scanned poses; nothing else should run meanwhile"
    script:
        "../scripts/benchmark.py"


rule benchmark_levels_figures:
    input:
        expand(paths.benchmark_of("levels/{part}.json"), part=[*LEVELS, "creases"]),
    output:
        paths.benchmark_of("levels.json"),
    log:
        paths.benchmark_of("logs/benchmark_levels_figures.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_levels_figures.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="levels",
        arguments=lambda w, input: ["merge", *input],
    message:
        "levels below the simulation: all figures"
    script:
        "../scripts/benchmark.py"


rule benchmark_levels:
    input:
        paths.benchmark_of("levels.json"),
    output:
        paths.benchmark_of("levels.png"),
        paths.benchmark_of("levels.md"),
    log:
        paths.benchmark_of("logs/benchmark_levels.log"),
    benchmark:
        paths.benchmark_of("jobs/benchmark_levels.tsv")
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        name="levels.document",
        arguments=lambda w, input: [*input],
    message:
        "levels below the simulation: picture and table"
    script:
        "../scripts/benchmark.py"
