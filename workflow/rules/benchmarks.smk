# What is timed, and against what; asked for by name: snakemake -j1 benchmark_fem, benchmark_bones, …

SEEDED = "config/datasets/phantom-hand-seeded.yaml"
BENCHMARK_POSES = ["neutral", "fist"]  # of the walkers' regions


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
        "what the coupled truth says of itself, on a toy finger"
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
        "upper envelopes of many functions; a real hand's template carried to another by feature points"
    script:
        "../scripts/benchmark.py"


SCANS = {  # parts of the benchmark of scans, modules of benchmarks.scans: what each needs to be built
    "foot": [],
    "knee": [],
    "skin": [],
    "alignment": expand(paths.metrics_of("rig"), subject="phantom-finger"),
    "effects": [],
    "from_raw": expand(paths.metrics_of("skin"), subject="phantom-finger"),
}


rule benchmark_scans_part:
    input:
        lambda w: SCANS[w.part],
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


TRUST = {  # parts of the benchmark of trust: what each needs to be built
    "solver": [],
    "frames": expand(paths.metrics_of("skin"), subject="phantom-hand-preview"),
    "seeds": expand(paths.metrics_of("segmentation"), subject="phantom-hand-preview"),
    "readers": [],
    "stale": [],
    "kills": [],
}


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
