# Variants of the full model beside it: one part left out or changed, or one organ replaced by its truth.


use rule fit_hooks as fit_hooks_without_flesh with:
    input:
        rig=paths.RIG,
        neutral=paths.NEUTRAL_TENDON,
        poses=in_poses(paths.POSED_TENDON, Role.example),
        flesh=[],
    output:
        paths.ablated(paths.HOOKS).replace("{variant}", "no_flesh"),
    log:
        paths.log_of("fit_hooks_without_flesh", "tendon"),
    benchmark:
        paths.cost_of("fit_hooks_without_flesh", "tendon")
    message:
        "{wildcards.subject}: hooks of the {wildcards.tendon} tendon on bones alone"


use rule fit_muscle_strains as fit_muscles_without_flesh with:
    input:
        rig=paths.RIG,
        neutral=paths.NEUTRAL_MUSCLES,
        shapes=paths.MUSCLE_SHAPES,
        separated=in_poses(paths.SEPARATED_MUSCLES, Role.example),
        flesh=[],
    output:
        paths.ablated(paths.MUSCLE_STRAINS).replace("{variant}", "no_flesh"),
    log:
        paths.log_of("fit_muscles_without_flesh", "muscle"),
    benchmark:
        paths.cost_of("fit_muscles_without_flesh", "muscle")
    message:
        "{wildcards.subject}: plastic strains of {wildcards.muscle} without flesh"


use rule fit_muscle_strains as fit_unseparated_muscles with:
    input:
        rig=paths.RIG,
        neutral=paths.NEUTRAL_MUSCLES,
        shapes=paths.MUSCLE_SHAPES,
        separated=[],
        flesh=in_flesh(Role.neutral, Role.example),
    output:
        paths.ablated(paths.MUSCLE_STRAINS).replace("{variant}", "no_separation"),
    log:
        paths.log_of("fit_unseparated_muscles", "muscle"),
    benchmark:
        paths.cost_of("fit_unseparated_muscles", "muscle")
    message:
        "{wildcards.subject}: plastic strains of {wildcards.muscle}, not separated"


rule mesh_ablated_fat:
    input:
        rig=paths.RIG,
        inner=in_neutral(paths.POSE_INNER),
        skin=paths.SKIN,
        fat=paths.FAT,
    output:
        paths.ablated(paths.FAT),
    log:
        paths.log_of("mesh_ablated_fat", "variant"),
    benchmark:
        paths.cost_of("mesh_ablated_fat", "variant")
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        edge=SETTINGS.sizes.fat,
    message:
        "{wildcards.subject}: the fat of {wildcards.variant}"
    script:
        "../scripts/mesh_ablated_fat.py"


rule simulate_ablated_inner:
    input:
        rig=paths.RIG,
        inner=paths.POSE_INNER,
        layers=ablated_layer_files,
        flesh=flesh_under_variant,
        truth=lambda w: (in_truth(paths.TRUTH)(w) if VARIANTS[w.variant].true else []),
    output:
        paths.ablated(paths.POSE_INNER),
    log:
        paths.log_of("simulate_ablated_inner", "variant", "pose"),
    benchmark:
        paths.cost_of("simulate_ablated_inner", "variant", "pose")
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        dataset=of_layers(lambda w: VARIANTS[w.variant].loaded, "neutral"),
    message:
        "{wildcards.subject}: layers under the fat in {wildcards.pose}, {wildcards.variant}"
    script:
        "../scripts/simulate_ablated_inner.py"


use rule fit_fat_strains as fit_ablated_strains with:
    input:
        rig=paths.RIG,
        mesh=of_variant(paths.FAT, lambda variant: variant.own_fat),
        inner=paths.ablated(paths.POSE_INNER),
        scan=example_scan,
    output:
        paths.ablated(paths.FAT_FIT),
    log:
        paths.log_of("fit_ablated_strains", "variant", "pose"),
    benchmark:
        paths.cost_of("fit_ablated_strains", "variant", "pose")
    message:
        "{wildcards.subject}: plastic strains of the fat in {wildcards.pose}, {wildcards.variant}"


use rule collect_fat_strains as collect_ablated_strains with:
    input:
        rig=paths.RIG,
        mesh=of_variant(paths.FAT, lambda variant: variant.own_fat),
        poses=in_poses(paths.ablated(paths.FAT_FIT), Role.example),
    output:
        paths.ablated(paths.FAT_STRAINS),
    log:
        paths.log_of("collect_ablated_strains", "variant"),
    benchmark:
        paths.cost_of("collect_ablated_strains", "variant")
    message:
        "{wildcards.subject}: pose space of the fat, {wildcards.variant}"


rule simulate_ablated_skin:
    input:
        inner=paths.ablated(paths.POSE_INNER),
        fat=of_variant(paths.FAT, lambda variant: variant.own_fat),
        strains=of_variant(paths.FAT_STRAINS, lambda variant: variant.own_strains),
    output:
        paths.ablated(paths.POSE_SKIN),
    log:
        paths.log_of("simulate_ablated_skin", "variant", "pose"),
    benchmark:
        paths.cost_of("simulate_ablated_skin", "variant", "pose")
    threads: 1
    resources:
        mem_mb=at_size("fat", 2500, 4500),
        runtime=at_size("fat", 10, 60),
    message:
        "{wildcards.subject}: skin of {wildcards.pose}, {wildcards.variant}"
    script:
        "../scripts/simulate_ablated_skin.py"


rule evaluate_ablations:
    input:
        rig=paths.RIG,
        skin=paths.SKIN,
        scans=lambda w: scans(w.subject, scanned(w.subject)),
        skins=lambda w: expand(
            paths.POSE_SKIN, pose=scanned(w.subject), allow_missing=True
        ),
        passive=lambda w: expand(
            paths.POSE_PASSIVE_SKIN, pose=scanned(w.subject), allow_missing=True
        ),
        inner=lambda w: expand(
            paths.POSE_INNER, pose=scanned(w.subject), allow_missing=True
        ),
        ablated_skins=of_ablations(paths.POSE_SKIN),
        ablated_inner=of_ablations(paths.POSE_INNER),
        truth=in_truth(paths.TRUTH),
    output:
        metrics=paths.metrics_of("ablations"),
        table=paths.table_of("ablations"),
    log:
        paths.log_of("evaluate_ablations"),
    benchmark:
        paths.cost_of("evaluate_ablations")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "truth", "root", "tendons.*.bones"),
        costs=costs_of(
            "fit_hooks_without_flesh",
            "fit_muscles_without_flesh",
            "fit_unseparated_muscles",
            "mesh_ablated_fat",
            "simulate_ablated_inner",
            "fit_ablated_strains",
            "collect_ablated_strains",
            "simulate_ablated_skin",
        ),
    message:
        "{wildcards.subject}: the full model beside its variants"
    script:
        "../scripts/evaluate_ablations.py"
