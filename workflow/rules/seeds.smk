# Seeds of the poses after neutral, proposed from the neutral bones, the joints and the pose's image.


rule propose_seeds:
    input:
        volume=of_pose("volume"),
        neutral=lambda w: f"results/{w.subject}/segmentation/{neutral(w.subject)}/surfaces.h5",
    output:
        seeds="results/{subject}/segmentation/{pose}/seeds.nii.gz",
        confidence="results/{subject}/segmentation/{pose}/seeds.json",
        located="results/{subject}/segmentation/{pose}/located.h5",
    log:
        "results/{subject}/logs/propose_seeds/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/propose_seeds/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=reads(
            *image_of(),
            "bones.*.label",
            "joints.*.parent",
            "joints.*.child",
            "joints.*.angles",
            "joints.*.axis_hints",
            "joints.*.limits_deg",
        ),
    message:
        "{wildcards.subject}: propose seeds of {wildcards.pose}"
    script:
        "../scripts/propose_seeds.py"


rule evaluate_seeds:
    input:
        neutral=lambda w: f"results/{w.subject}/segmentation/{neutral(w.subject)}/surfaces.h5",
        located=lambda w: expand(
            "results/{subject}/segmentation/{pose}/located.h5",
            pose=proposed_poses(w.subject),
            allow_missing=True,
        ),
    output:
        "results/{subject}/metrics/seeds.json",
    log:
        "results/{subject}/logs/evaluate_seeds/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_seeds/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads(*image_of("{proposed}"), "bones.*.label", "truth"),
        poses=lambda w: proposed_poses(w.subject),
    message:
        "{wildcards.subject}: proposed seeds, and how many bones need a person"
    script:
        "../scripts/evaluate_seeds.py"
