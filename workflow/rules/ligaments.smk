# Ligaments: as muscles, without contact.


rule fit_ligament:
    input:
        rig="results/{subject}/rig.h5",
        templates="results/{subject}/templates.h5",
    output:
        "results/{subject}/ligaments/{ligament}.h5",
    log:
        "results/{subject}/logs/fit_ligament/{ligament}.log",
    benchmark:
        "results/{subject}/benchmarks/fit_ligament/{ligament}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("neutral"),
    message:
        "{wildcards.subject}: place the {wildcards.ligament} ligament"
    script:
        "../scripts/fit_ligament.py"
