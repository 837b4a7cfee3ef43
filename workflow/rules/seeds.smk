# Seeds of the poses after neutral, proposed from the neutral bones, the joints and the pose's image.


rule propose_seeds:
    input:
        volume=of_pose("volume"),
        neutral=in_neutral(paths.BONE_SURFACES),
        carried=carried_template,
    output:
        seeds=paths.SEEDS,
        confidence=paths.SEEDS_CONFIDENCE,
        located=paths.LOCATED,
    log:
        paths.log_of("propose_seeds", "pose"),
    benchmark:
        paths.cost_of("propose_seeds", "pose")
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=reads(
            *image_of(),
            "neutral",
            "segmentation",
            "bones.*.label",
            "joints.*.parent",
            "joints.*.child",
            "joints.*.angles",
            "joints.*.axis_hints",
            "joints.*.limits_deg",
        ),
        labelled=lambda w: in_label_map(w.subject, w.pose),
    message:
        "{wildcards.subject}: propose seeds of {wildcards.pose}"
    script:
        "../scripts/propose_seeds.py"


rule evaluate_seeds:
    input:
        neutral=in_neutral(paths.BONE_SURFACES),
        located=lambda w: expand(
            paths.LOCATED,
            pose=proposed_poses(w.subject),
            allow_missing=True,
        ),
        volumes=lambda w: volumes(w.subject, proposed_poses(w.subject)),
        truth=lambda w: [
            path
            for pose, path in zip(
                dataset(w.subject).poses, in_truth(paths.TRUE_MARROW)(w)
            )
            if pose in proposed_poses(w.subject)
        ],
    output:
        paths.metrics_of("seeds"),
    log:
        paths.log_of("evaluate_seeds"),
    benchmark:
        paths.cost_of("evaluate_seeds")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads(*image_of("{proposed}"), "bones.*.label", "truth"),
        poses=lambda w: proposed_poses(w.subject),
        costs=costs_of("propose_seeds"),
    message:
        "{wildcards.subject}: proposed seeds, and how many bones need a person"
    script:
        "../scripts/evaluate_seeds.py"
