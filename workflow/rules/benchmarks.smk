# What is timed, and against what; asked for by name: snakemake -j1 benchmark_fem


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
