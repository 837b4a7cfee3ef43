# Volumes to labels and bone surfaces (004 section 3.1).


rule segment_pose:
    input:
        volume=of_pose("volume"),
        seeds=seeds_of_pose,
    output:
        "results/{subject}/segmentation/{pose}/bones.h5",
    log:
        "results/{subject}/logs/segment_pose/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/segment_pose/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
        runtime=20,
    params:
        dataset=reads(
            *image_of(),
            "bones.*.label",
            "other_labels",
            "neutral",
            "poses.{pose}.seeds",
        ),
        scribbled=scribbled_bones,
    message:
        "{wildcards.subject}: segment the bones of {wildcards.pose}"
    script:
        "../scripts/segment_pose.py"


# A bone with scribbles again: they are an input of this rule and of the merging alone.
rule correct_bone:
    input:
        volume=of_pose("volume"),
        seeds=seeds_of_pose,
        scribbles=lambda w: scribbles(w.subject, w.pose, w.bone),
    output:
        "results/{subject}/segmentation/{pose}/corrected/{bone}.h5",
    log:
        "results/{subject}/logs/correct_bone/{pose}/{bone}.log",
    benchmark:
        "results/{subject}/benchmarks/correct_bone/{pose}/{bone}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads(*image_of(), "bones.*.label", "other_labels"),
    message:
        "{wildcards.subject}: segment {wildcards.bone} in {wildcards.pose} with its scribbles"
    script:
        "../scripts/correct_bone.py"


rule merge_labels:
    input:
        volume=of_pose("volume"),
        seeds=seeds_of_pose,
        bones="results/{subject}/segmentation/{pose}/bones.h5",
        corrected=corrected_bones,
        scribbles=all_scribbles,
        neutral=neutral_looks,
    output:
        labels="results/{subject}/segmentation/{pose}/labels.nii.gz",
        table="results/{subject}/segmentation/{pose}/labels.json",
        surfaces="results/{subject}/segmentation/{pose}/surfaces.h5",
        looks="results/{subject}/segmentation/{pose}/looks.json",
    log:
        "results/{subject}/logs/merge_labels/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/merge_labels/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=of_labels,
    message:
        "{wildcards.subject}: labels and surfaces of {wildcards.pose}"
    script:
        "../scripts/merge_labels.py"


rule evaluate_segmentation:
    input:
        labels=in_poses("results/{subject}/segmentation/{pose}/labels.nii.gz"),
        looks=in_poses("results/{subject}/segmentation/{pose}/looks.json"),
    output:
        "results/{subject}/metrics/segmentation.json",
    log:
        "results/{subject}/logs/evaluate_segmentation/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_segmentation/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("bones.*.label", "poses.names", "neutral", "truth", "root"),
    message:
        "{wildcards.subject}: segmentation against truth"
    script:
        "../scripts/evaluate_segmentation.py"
