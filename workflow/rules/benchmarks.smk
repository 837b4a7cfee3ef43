# What is timed, and against what; asked for by name: snakemake -j1 benchmark_fem, benchmark_bones, …

SEEDED = "config/datasets/phantom-hand-seeded.yaml"
BENCHMARK_POSES = ["neutral", "fist"]  # of the walkers' regions


rule benchmark_fem:
    output:
        "results/benchmarks/fem.json",
    log:
        "results/benchmarks/logs/benchmark_fem.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_fem.tsv"
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
        "results/benchmarks/bones.json",
    log:
        "results/benchmarks/logs/benchmark_bones.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_bones.tsv"
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
        "results/benchmarks/shapes.json",
    log:
        "results/benchmarks/logs/benchmark_shapes.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_shapes.tsv"
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
            "results/phantom-hand-seeded/data/{part}.nii.gz",
            part=[
                part.format(pose=pose)
                for pose in BENCHMARK_POSES
                for part in ("volumes/{pose}", "seeds/{pose}", "truth/{pose}.marrow")
            ],
        ),
    output:
        "results/benchmarks/segmentation.json",
    log:
        "results/benchmarks/logs/benchmark_segmentation.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_segmentation.tsv"
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
        "results/benchmarks/truth.json",
        "results/benchmarks/truth-refinement.json",
        "results/benchmarks/truth-toy.png",
        "results/benchmarks/truth-convergence.png",
    log:
        "results/benchmarks/logs/benchmark_truth.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_truth.tsv"
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
        "results/benchmarks/anatomy.json",
    log:
        "results/benchmarks/logs/benchmark_anatomy.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_anatomy.tsv"
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


TRUST = {  # parts of the benchmark of trust: what each needs to be built
    "solver": [],
    "frames": ["results/phantom-hand-preview/metrics/skin.json"],
    "seeds": ["results/phantom-hand-preview/metrics/segmentation.json"],
    "readers": [],
    "stale": [],
    "kills": [],
}


rule benchmark_trust_part:
    input:
        lambda w: TRUST[w.part],
    output:
        "results/benchmarks/trust/{part}.json",
    log:
        "results/benchmarks/logs/benchmark_trust_part/{part}.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_trust_part/{part}.tsv"
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
        expand("results/benchmarks/trust/{part}.json", part=TRUST),
    output:
        "results/benchmarks/trust.json",
    log:
        "results/benchmarks/logs/benchmark_trust.log",
    benchmark:
        "results/benchmarks/jobs/benchmark_trust.tsv"
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
