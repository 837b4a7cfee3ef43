# Generated subjects: what a scanner, a person and a truth would give. Scanned subjects: the check of it.


rule generate_templates:
    output:
        directory("results/{subject}/data/templates"),
        directory("results/{subject}/data/curves"),
    log:
        "results/{subject}/logs/generate_templates/all.log",
    benchmark:
        "results/{subject}/benchmarks/generate_templates/all.tsv"
    wildcard_constraints:
        subject=f"(?!(?:{COUPLED})/)[a-z][a-z0-9-]*",
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_whole(
            "name",
            "generator",
            "anatomy",
            "seed",
            "hand",
            "root",
            "poses.*.scan",
            "bones.*.template",
            "muscles.*.template",
            "muscles.*.attachments",
            "ligaments.*.template",
            "ligaments.*.attachments",
            "tendons.*.path",
            "nails",
        ),
    message:
        "{wildcards.subject}: templates, tendon curves and nails"
    script:
        "../scripts/generate_templates.py"


rule generate_pose:
    output:
        volume="results/{subject}/data/volumes/{pose}.nii.gz",
        seeds="results/{subject}/data/seeds/{pose}.nii.gz",
        scan="results/{subject}/data/scans/{pose}.ply",
        truth="results/{subject}/data/truth/{pose}.h5",
        bones="results/{subject}/data/truth/{pose}.bones.nii.gz",
        marrow="results/{subject}/data/truth/{pose}.marrow.nii.gz",
    log:
        "results/{subject}/logs/generate_pose/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/generate_pose/{pose}.tsv"
    wildcard_constraints:
        subject=f"(?!(?:{BONES_ALONE}|{COUPLED})/)[a-z][a-z0-9-]*",
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=reads_whole(
            "name",
            "generator",
            "anatomy",
            "seed",
            "hand",
            "scanner",
            "truth",
            "root",
            "poses.{pose}.scan",
            "poses.{pose}.volume",
            "poses.{pose}.seeds",
            "bones.*.label",
        ),
    message:
        "{wildcards.subject}: images, scan and truth of {wildcards.pose}"
    script:
        "../scripts/generate_pose.py"


rule generate_bones:
    output:
        volume="results/{subject}/data/volumes/{pose}.nii.gz",
        truth="results/{subject}/data/truth/{pose}.h5",
        bones="results/{subject}/data/truth/{pose}.bones.nii.gz",
        marrow="results/{subject}/data/truth/{pose}.marrow.nii.gz",
    log:
        "results/{subject}/logs/generate_bones/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/generate_bones/{pose}.tsv"
    wildcard_constraints:
        subject=BONES_ALONE,
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads_whole(
            "name",
            "generator",
            "anatomy",
            "seed",
            "hand",
            "scanner",
            "truth",
            "root",
            "poses.*.scan",
            "poses.{pose}.volume",
            "poses.{pose}.seeds",
            "bones.*.label",
            "muscles.names",
            "ligaments.names",
            "tendons.names",
            "nails.names",
        ),
    message:
        "{wildcards.subject}: image and truth of the bones of {wildcards.pose}"
    script:
        "../scripts/generate_pose.py"


rule generate_seeds:
    input:
        bones="results/{subject}/data/truth/{pose}.bones.nii.gz",
        marrow="results/{subject}/data/truth/{pose}.marrow.nii.gz",
    output:
        "results/{subject}/data/seeds/{pose}.nii.gz",
    log:
        "results/{subject}/logs/generate_seeds/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/generate_seeds/{pose}.tsv"
    wildcard_constraints:
        subject=f"{BONES_ALONE}|{COUPLED}",
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_whole("name", "seed", "truth", "root", "poses.{pose}.seeds"),
    message:
        "{wildcards.subject}: seeds of {wildcards.pose} as a person would draw them"
    script:
        "../scripts/generate_seeds.py"


rule check_subject:
    input:
        files=given_files,
    output:
        "results/{subject}/check.json",
    log:
        "results/{subject}/logs/check_subject/all.log",
    benchmark:
        "results/{subject}/benchmarks/check_subject/all.tsv"
    priority: 1  # before any job
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_whole("*"),
    message:
        "{wildcards.subject}: images, scans, templates and attachments are what the dataset says"
    script:
        "../scripts/check_subject.py"
