# Simpler models of the skin beside the full one: without plastic strains, and one tissue (Zheng 2022 Table 4); one tissue
# with plastic strains (Ichim 2017), skinning, a pivot rig.


rule simulate_passive_skin:
    input:
        rig=paths.RIG,
        inner=paths.POSE_INNER,
        fat=paths.FAT,
        strains=paths.FAT_STRAINS,
        soft_tissue=paths.SOFT_TISSUE,
    output:
        paths.POSE_PASSIVE_SKIN,
    log:
        paths.log_of("simulate_passive_skin", "pose"),
    benchmark:
        paths.cost_of("simulate_passive_skin", "pose")
    threads: 1
    resources:
        mem_mb=at_size("fat", 2500, 4500),
        runtime=at_size("fat", 10, 60),
    message:
        "{wildcards.subject}: skin of {wildcards.pose} without plastic strains, and by one tissue"
    script:
        "../scripts/simulate_passive_skin.py"


use rule fit_fat_strains as fit_soft_tissue_strains with:
    input:
        rig=paths.RIG,
        mesh=paths.SOFT_TISSUE,
        inner=paths.POSE_INNER,
        scan=example_scan,
    output:
        paths.SOFT_TISSUE_FIT,
    log:
        paths.log_of("fit_soft_tissue_strains", "pose"),
    benchmark:
        paths.cost_of("fit_soft_tissue_strains", "pose")
    message:
        "{wildcards.subject}: plastic strains of the one soft tissue in {wildcards.pose}"


use rule collect_fat_strains as collect_soft_tissue_strains with:
    input:
        rig=paths.RIG,
        mesh=paths.SOFT_TISSUE,
        poses=in_poses(paths.SOFT_TISSUE_FIT, Role.example),
    output:
        paths.SOFT_TISSUE_STRAINS,
    log:
        paths.log_of("collect_soft_tissue_strains"),
    benchmark:
        paths.cost_of("collect_soft_tissue_strains")
    message:
        "{wildcards.subject}: pose space of the one soft tissue"


rule simulate_baselines:
    input:
        rig=paths.RIG,
        inner=paths.POSE_INNER,
        soft_tissue=paths.SOFT_TISSUE,
        strains=paths.SOFT_TISSUE_STRAINS,
    output:
        paths.POSE_BASELINES,
    log:
        paths.log_of("simulate_baselines", "pose"),
    benchmark:
        paths.cost_of("simulate_baselines", "pose")
    threads: 1
    resources:
        mem_mb=at_size("fat", 2500, 4500),
        runtime=at_size("fat", 10, 60),
    message:
        "{wildcards.subject}: skin of {wildcards.pose} by one tissue with strains, and by skinning"
    script:
        "../scripts/simulate_baselines.py"


rule evaluate_baselines:
    input:
        rig=paths.RIG,
        skin=paths.SKIN,
        scans=lambda w: scans(w.subject, scanned(w.subject)),
        skins=lambda w: expand(
            paths.POSE_SKIN,
            pose=scanned(w.subject),
            allow_missing=True,
        ),
        passive=lambda w: expand(
            paths.POSE_PASSIVE_SKIN,
            pose=scanned(w.subject),
            allow_missing=True,
        ),
        baselines=lambda w: expand(
            paths.POSE_BASELINES,
            pose=scanned(w.subject),
            allow_missing=True,
        ),
        truth=in_truth(paths.TRUTH),
    output:
        metrics=paths.metrics_of("baselines"),
        table=paths.table_of("baselines"),
    log:
        paths.log_of("evaluate_baselines"),
    benchmark:
        paths.cost_of("evaluate_baselines")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "truth", "root"),
        costs=costs_of(
            "mesh_soft_tissue",
            "fit_soft_tissue_strains",
            "collect_soft_tissue_strains",
            "simulate_passive_skin",
            "simulate_baselines",
        ),
    message:
        "{wildcards.subject}: the full model beside simpler ones"
    script:
        "../scripts/evaluate_baselines.py"
