# Cloths around bones and around muscles (Zheng 2022 §6).


rule make_bone_fascia:
    input:
        rig=paths.RIG,
        regions=lambda w: painted_regions(w.subject, "bone_fascia"),
    output:
        paths.BONE_FASCIA,
    log:
        paths.log_of("make_bone_fascia"),
    benchmark:
        paths.cost_of("make_bone_fascia")
    threads: 1
    resources:
        mem_mb=at_size("bone_fascia", 1500, 4500),
        runtime=at_size("bone_fascia", 10, 30),
    params:
        dataset=reads("joints.*.parent", "joints.*.child"),
        edge=SETTINGS.sizes.bone_fascia,
    message:
        "{wildcards.subject}: bone fascia"
    script:
        "../scripts/make_bone_fascia.py"


rule make_muscle_fascia:
    input:
        rig=paths.RIG,
        muscles=lambda w: expand(
            paths.MUSCLE_STRAINS,
            muscle=dataset(w.subject).muscles,
            allow_missing=True,
        ),
        regions=lambda w: painted_regions(w.subject, "muscle_fascia"),
    output:
        paths.MUSCLE_FASCIA,
    log:
        paths.log_of("make_muscle_fascia"),
    benchmark:
        paths.cost_of("make_muscle_fascia")
    threads: 1
    resources:
        mem_mb=at_size("muscle_fascia", 1500, 2500),
        runtime=at_size("muscle_fascia", 10, 20),
    params:
        dataset=reads("muscles.names"),
        edge=SETTINGS.sizes.muscle_fascia,
    message:
        "{wildcards.subject}: muscle fascia"
    script:
        "../scripts/make_muscle_fascia.py"
