# Volumes to labels and bone surfaces (Wang 2019 §3.1).


rule segment_pose:
    input:
        volume=of_pose("volume"),
        seeds=seeds_of_pose,
        labels=of_pose("labels"),
        channels=channels_of_pose,
    output:
        paths.SEGMENTED,
    log:
        paths.log_of("segment_pose", "pose"),
    benchmark:
        paths.cost_of("segment_pose", "pose")
    threads: 1
    resources:
        mem_mb=2500,
        runtime=20,
    params:
        dataset=reads_with_channels(
            *image_of(),
            "bones.*.label",
            "other_labels",
            "segmentation",
            "contrast",
            "neutral",
            "poses.{pose}.seeds",
            "poses.{pose}.labels_show",
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
        labels=of_pose("labels"),
        channels=channels_of_pose,
    output:
        paths.CORRECTED,
    log:
        paths.log_of("correct_bone", "pose", "bone"),
    benchmark:
        paths.cost_of("correct_bone", "pose", "bone")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_with_channels(
            *image_of(),
            "bones.*.label",
            "other_labels",
            "contrast",
            "segmentation",
            "poses.{pose}.labels_show",
        ),
    message:
        "{wildcards.subject}: segment {wildcards.bone} in {wildcards.pose} with its scribbles"
    script:
        "../scripts/correct_bone.py"


rule merge_labels:
    input:
        volume=of_pose("volume"),
        seeds=seeds_of_pose,
        bones=paths.SEGMENTED,
        corrected=corrected_bones,
        scribbles=all_scribbles,
        neutral=neutral_looks,
        labels=of_pose("labels"),
    output:
        labels=paths.LABELS,
        table=paths.LABEL_TABLE,
        surfaces=paths.BONE_SURFACES,
        looks=paths.LOOKS,
    log:
        paths.log_of("merge_labels", "pose"),
    benchmark:
        paths.cost_of("merge_labels", "pose")
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
        labels=in_poses(paths.LABELS),
        looks=in_poses(paths.LOOKS),
        truth=true_labels,
    output:
        paths.metrics_of("segmentation"),
    log:
        paths.log_of("evaluate_segmentation"),
    benchmark:
        paths.cost_of("evaluate_segmentation")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("bones.*.label", "poses.names", "neutral", "truth", "root"),
        costs=costs_of("segment_pose", "correct_bone", "merge_labels"),
    message:
        "{wildcards.subject}: segmentation against truth"
    script:
        "../scripts/evaluate_segmentation.py"
