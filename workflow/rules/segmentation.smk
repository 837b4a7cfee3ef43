# Volumes to labels and bone surfaces (004 section 3.1).


rule segment_bone:
    input:
        dataset=ancient(of_dataset),
        check=subject_check,
        volume=of_pose("volume"),
        seeds=seeds_of_pose,
        scribbles=lambda w: scribbles(w.subject, w.pose, w.bone),
    output:
        "results/{subject}/segmentation/{pose}/bones/{bone}.h5",
    log:
        "results/{subject}/logs/segment_bone/{pose}/{bone}.log",
    benchmark:
        "results/{subject}/benchmarks/segment_bone/{pose}/{bone}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=dataset_digest,
    message:
        "{wildcards.subject}: segment {wildcards.bone} in {wildcards.pose}"
    script:
        "../scripts/segment_bone.py"


rule merge_labels:
    input:
        dataset=ancient(of_dataset),
        volume=of_pose("volume"),
        seeds=seeds_of_pose,
        bones=lambda w: expand(
            "results/{subject}/segmentation/{pose}/bones/{bone}.h5",
            bone=dataset(w.subject).bones,
            allow_missing=True,
        ),
    output:
        labels="results/{subject}/segmentation/{pose}/labels.nii.gz",
        table="results/{subject}/segmentation/{pose}/labels.json",
        surfaces="results/{subject}/segmentation/{pose}/surfaces.h5",
    log:
        "results/{subject}/logs/merge_labels/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/merge_labels/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=dataset_digest,
    message:
        "{wildcards.subject}: labels and surfaces of {wildcards.pose}"
    script:
        "../scripts/merge_labels.py"


rule evaluate_segmentation:
    input:
        dataset=ancient(of_dataset),
        labels=in_poses("results/{subject}/segmentation/{pose}/labels.nii.gz"),
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
        dataset=dataset_digest,
    message:
        "{wildcards.subject}: segmentation against truth"
    script:
        "../scripts/evaluate_segmentation.py"
