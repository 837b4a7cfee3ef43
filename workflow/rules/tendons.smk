# Tendons: rods, hooks (Zheng 2022 §5).


rule extract_tendon:
    input:
        rig=paths.RIG,
        volume=neutral_volume,
        path=lambda w: curve_folder(
            w.subject, dataset(w.subject).tendons[w.tendon].path
        ),
        carried=carried_template,
    output:
        paths.NEUTRAL_TENDON,
    log:
        paths.log_of("extract_tendon", "tendon"),
    benchmark:
        paths.cost_of("extract_tendon", "tendon")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads(
            *image_of("{neutral}"),
            "neutral",
            "tendons.{tendon}.bones",
            "tendons.{tendon}.path",
            "tendons.{tendon}.radius",
        ),
        edge=SETTINGS.sizes.tendon,
    message:
        "{wildcards.subject}: extract the {wildcards.tendon} tendon in neutral"
    script:
        "../scripts/extract_tendon.py"


rule register_tendon:
    input:
        rig=paths.RIG,
        volume=of_pose("volume"),
        neutral=paths.NEUTRAL_TENDON,
        registration=paths.REGISTRATION,
    output:
        paths.POSED_TENDON,
    log:
        paths.log_of("register_tendon", "tendon", "pose"),
    benchmark:
        paths.cost_of("register_tendon", "tendon", "pose")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads(*image_of(), "tendons.{tendon}.bones"),
    message:
        "{wildcards.subject}: register the {wildcards.tendon} tendon in {wildcards.pose}"
    script:
        "../scripts/register_tendon.py"


rule simulate_flesh:
    input:
        rig=paths.RIG,
        layers=lambda w: layer_files(w.subject, ["bones", "flesh"]),
    output:
        paths.POSE_FLESH,
    log:
        paths.log_of("simulate_flesh", "pose"),
    benchmark:
        paths.cost_of("simulate_flesh", "pose")
    threads: 1
    resources:
        mem_mb=at_size("flesh", 2000, 4000, like="fat"),
        runtime=at_size("flesh", 10, 30, like="fat"),
    params:
        dataset=reads(*layer_fields(["bones", "flesh"])),
    message:
        "{wildcards.subject}: the flesh in {wildcards.pose}, which carries tendons and muscles"
    script:
        "../scripts/simulate_flesh.py"


rule fit_hooks:
    input:
        rig=paths.RIG,
        neutral=paths.NEUTRAL_TENDON,
        poses=in_poses(paths.POSED_TENDON, Role.example),
        flesh=in_flesh(Role.neutral, Role.example),
    output:
        paths.HOOKS,
    log:
        paths.log_of("fit_hooks", "tendon"),
    benchmark:
        paths.cost_of("fit_hooks", "tendon")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("neutral", "examples", "tendons.{tendon}.bones"),
    message:
        "{wildcards.subject}: fit the hooks of the {wildcards.tendon} tendon"
    script:
        "../scripts/fit_hooks.py"


rule evaluate_tendons:
    input:
        rig=paths.RIG,
        tendons=lambda w: expand(
            paths.HOOKS,
            tendon=dataset(w.subject).tendons,
            allow_missing=True,
        ),
        flesh=in_flesh(Role.example, Role.heldout),
        truth=in_truth(paths.TRUTH, Role.example, Role.heldout),
    output:
        paths.metrics_of("tendons"),
    log:
        paths.log_of("evaluate_tendons"),
    benchmark:
        paths.cost_of("evaluate_tendons")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "truth", "root"),
        costs=costs_of(
            "simulate_flesh", "extract_tendon", "register_tendon", "fit_hooks"
        ),
    message:
        "{wildcards.subject}: simulated tendons against truth"
    script:
        "../scripts/evaluate_tendons.py"
