# Tendons: rods, hooks (Zheng 2022 §5).


rule extract_tendon:
    input:
        rig="results/{subject}/rig.h5",
        volume=neutral_volume,
        path=lambda w: curve_folder(
            w.subject, dataset(w.subject).tendons[w.tendon].path
        ),
    output:
        "results/{subject}/tendons/{tendon}/neutral.h5",
    log:
        "results/{subject}/logs/extract_tendon/{tendon}.log",
    benchmark:
        "results/{subject}/benchmarks/extract_tendon/{tendon}.tsv"
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
    message:
        "{wildcards.subject}: extract the {wildcards.tendon} tendon in neutral"
    script:
        "../scripts/extract_tendon.py"


rule register_tendon:
    input:
        rig="results/{subject}/rig.h5",
        volume=of_pose("volume"),
        neutral="results/{subject}/tendons/{tendon}/neutral.h5",
        registration="results/{subject}/registration/{pose}.h5",
    output:
        "results/{subject}/tendons/{tendon}/poses/{pose}.h5",
    log:
        "results/{subject}/logs/register_tendon/{tendon}/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/register_tendon/{tendon}/{pose}.tsv"
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
        rig="results/{subject}/rig.h5",
        layers=lambda w: layer_files(w.subject, ["bones", "flesh"]),
    output:
        "results/{subject}/poses/{pose}/flesh.h5",
    log:
        "results/{subject}/logs/simulate_flesh/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/simulate_flesh/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads(*layer_fields(["bones", "flesh"])),
    message:
        "{wildcards.subject}: the flesh in {wildcards.pose}, which carries tendons and muscles"
    script:
        "../scripts/simulate_flesh.py"


rule fit_hooks:
    input:
        rig="results/{subject}/rig.h5",
        neutral="results/{subject}/tendons/{tendon}/neutral.h5",
        poses=in_poses(
            "results/{subject}/tendons/{tendon}/poses/{pose}.h5", Role.example
        ),
        flesh=in_flesh(Role.neutral, Role.example),
    output:
        "results/{subject}/tendons/{tendon}/hooks.h5",
    log:
        "results/{subject}/logs/fit_hooks/{tendon}.log",
    benchmark:
        "results/{subject}/benchmarks/fit_hooks/{tendon}.tsv"
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
        rig="results/{subject}/rig.h5",
        tendons=lambda w: expand(
            "results/{subject}/tendons/{tendon}/hooks.h5",
            tendon=dataset(w.subject).tendons,
            allow_missing=True,
        ),
        flesh=in_flesh(Role.example, Role.heldout),
    output:
        "results/{subject}/metrics/tendons.json",
    log:
        "results/{subject}/logs/evaluate_tendons/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_tendons/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "truth", "root"),
    message:
        "{wildcards.subject}: simulated tendons against truth"
    script:
        "../scripts/evaluate_tendons.py"
