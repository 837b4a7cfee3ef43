# Registered bones to a kinematic rig (Wang 2019 §4).


rule carry_template:
    input:
        neutral=in_neutral(paths.BONE_SURFACES),
        templates=carried_files,
    output:
        paths.CARRIED_TEMPLATE,
    log:
        paths.log_of("carry_template"),
    benchmark:
        paths.cost_of("carry_template")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("root", "bones.*.template", "joints", "tendons", "nails"),
    message:
        "{wildcards.subject}: carry axis hints, tendons' paths and nails onto the bones"
    script:
        "../scripts/carry_template.py"


rule fit_rig:
    input:
        neutral=in_neutral(paths.BONE_SURFACES),
        registrations=in_poses(paths.REGISTRATION),
        truth=in_truth(paths.TRUTH, Role.example, Role.heldout),
        carried=carried_template,
    output:
        rig=paths.RIG,
        metrics=paths.metrics_of("rig"),
        table=report(
            paths.table_of("rig"),
            caption="../report/rig.rst",
            category="Bones",
            subcategory="{subject}",
        ),
        limits=report(
            paths.table_of("limits"),
            caption="../report/limits.rst",
            category="Bones",
            subcategory="{subject}",
        ),
    log:
        paths.log_of("fit_rig"),
    benchmark:
        paths.cost_of("fit_rig")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        organs=lambda w: has_organs(w.subject),
        dataset=reads("name", "poses.*.role", "bones.names", "joints", "truth", "root"),
    message:
        "{wildcards.subject}: fit the rig"
    script:
        "../scripts/fit_rig.py"


rule align_scan:
    input:
        scan=of_pose("scan"),
        volume=of_pose("volume"),
        rig=paths.RIG,
        neutral=neutral_skin,
    output:
        scan=paths.ALIGNED_SCAN,
        metrics=paths.metrics_of("scan-{pose}"),
    log:
        paths.log_of("align_scan", "pose"),
    benchmark:
        paths.cost_of("align_scan", "pose")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        dataset=reads(*image_of()),
    message:
        "{wildcards.subject}: align the scan of {wildcards.pose} to the skin in its image"
    script:
        "../scripts/align_scan.py"
