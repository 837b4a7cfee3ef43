# Cloths around bones and around muscles (Zheng 2022 §6).


rule make_bone_fascia:
    input:
        rig="results/{subject}/rig.h5",
        regions=lambda w: painted_regions(w.subject, "bone_fascia"),
    output:
        "results/{subject}/fascia/bone.h5",
    log:
        "results/{subject}/logs/make_bone_fascia/all.log",
    benchmark:
        "results/{subject}/benchmarks/make_bone_fascia/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("joints.*.parent", "joints.*.child"),
        edge=SETTINGS.edges.fascia,
    message:
        "{wildcards.subject}: bone fascia"
    script:
        "../scripts/make_bone_fascia.py"


rule make_muscle_fascia:
    input:
        rig="results/{subject}/rig.h5",
        muscles=lambda w: expand(
            "results/{subject}/muscles/{muscle}/strains.h5",
            muscle=dataset(w.subject).muscles,
            allow_missing=True,
        ),
        regions=lambda w: painted_regions(w.subject, "muscle_fascia"),
    output:
        "results/{subject}/fascia/muscle.h5",
    log:
        "results/{subject}/logs/make_muscle_fascia/all.log",
    benchmark:
        "results/{subject}/benchmarks/make_muscle_fascia/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("muscles.names"),
        edge=SETTINGS.edges.fascia,
    message:
        "{wildcards.subject}: muscle fascia"
    script:
        "../scripts/make_muscle_fascia.py"
