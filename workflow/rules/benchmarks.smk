# What is timed, and against what; asked for by name: snakemake -j1 benchmark_fem, benchmark_bones, benchmark_shapes


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
    message:
        "benchmarks of the equilibrium solver; nothing else should run meanwhile"
    script:
        "../scripts/benchmark_fem.py"


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
    message:
        "hard cases of the bones and their speed against error; nothing else should run meanwhile"
    script:
        "../scripts/benchmark_bones.py"


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
    message:
        "benchmarks of shapes from plastic strains; nothing else should run meanwhile"
    script:
        "../scripts/benchmark_shapes.py"
