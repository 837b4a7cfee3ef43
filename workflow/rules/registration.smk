# Neutral marrow into each pose (Wang 2019 §3.1).


rule register_bones:
    input:
        neutral=in_neutral(paths.BONE_SURFACES),
        target=paths.BONE_SURFACES,
        carried=carried_template,
        images=registered_images,
    output:
        paths.REGISTRATION,
    log:
        paths.log_of("register_bones", "pose"),
    benchmark:
        paths.cost_of("register_bones", "pose")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_registered(
            "neutral",
            "registration",
            "bones.names",
            "joints.*.parent",
            "joints.*.child",
            "joints.*.angles",
            "joints.*.axis_hints",
        ),
    message:
        "{wildcards.subject}: register the bones of {wildcards.pose}"
    script:
        "../scripts/register_bones.py"


rule evaluate_registration:
    input:
        neutral=in_neutral(paths.BONE_SURFACES),
        registrations=in_poses(paths.REGISTRATION),
        truth=in_truth(paths.TRUTH),
    output:
        metrics=paths.metrics_of("registration"),
        table=report(
            paths.table_of("registration"),
            caption="../report/registration.rst",
            category="Bones",
            subcategory="{subject}",
        ),
    log:
        paths.log_of("evaluate_registration"),
    benchmark:
        paths.cost_of("evaluate_registration")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.names", "neutral", "bones.names", "truth", "root"),
        costs=costs_of("register_bones"),
    message:
        "{wildcards.subject}: registration against truth"
    script:
        "../scripts/evaluate_registration.py"
