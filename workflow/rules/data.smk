# Generated subjects: what a scanner, a person and a truth would give. Scanned subjects: the check of it.


rule generate_templates:
    output:
        directory(paths.DATA_TEMPLATES),
        directory(paths.DATA_CURVES),
    log:
        paths.log_of("generate_templates"),
    benchmark:
        paths.cost_of("generate_templates")
    wildcard_constraints:
        subject=f"(?!(?:{COUPLED}|{LIMBS})/)[a-z][a-z0-9-]*",
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
        volume=paths.DATA_VOLUME,
        seeds=paths.DATA_SEEDS,
        scan=paths.DATA_SCAN,
        truth=paths.TRUTH,
        bones=paths.TRUE_BONES,
        marrow=paths.TRUE_MARROW,
    log:
        paths.log_of("generate_pose", "pose"),
    benchmark:
        paths.cost_of("generate_pose", "pose")
    wildcard_constraints:
        subject=f"(?!(?:{BONES_ALONE}|{COUPLED}|{SLIDING}|{LIMBS})/)[a-z][a-z0-9-]*",
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
            "images",
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
        volume=paths.DATA_VOLUME,
        truth=paths.TRUTH,
        bones=paths.TRUE_BONES,
        marrow=paths.TRUE_MARROW,
    log:
        paths.log_of("generate_bones", "pose"),
    benchmark:
        paths.cost_of("generate_bones", "pose")
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
            "images",
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
        bones=paths.TRUE_BONES,
        marrow=paths.TRUE_MARROW,
    output:
        paths.DATA_SEEDS,
    log:
        paths.log_of("generate_seeds", "pose"),
    benchmark:
        paths.cost_of("generate_seeds", "pose")
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


rule prepare_image:
    input:
        lambda w: source_image(w.subject, w.pose),
    output:
        paths.DATA_VOLUME,
    log:
        paths.log_of("prepare_image", "pose"),
    benchmark:
        paths.cost_of("prepare_image", "pose")
    wildcard_constraints:
        subject=LIMBS,
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_whole("limb.unit", "limb.shrunk"),
    message:
        "{wildcards.subject}: the real image of {wildcards.pose} in the build's unit, without shading"
    script:
        "../scripts/prepare_image.py"


rule paint_strokes:
    input:
        strokes=lambda w: whole_dataset(w.subject).limb.strokes,
        image=lambda w: source_image(w.subject, w.pose),
    output:
        paths.DATA_SEEDS,
    log:
        paths.log_of("paint_strokes", "pose"),
    benchmark:
        paths.cost_of("paint_strokes", "pose")
    wildcard_constraints:
        subject=LIMBS,
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_whole("limb.unit", "limb.shrunk", "bones.*.label"),
    message:
        "{wildcards.subject}: the strokes on {wildcards.pose} as a label volume"
    script:
        "../scripts/paint_strokes.py"


rule check_subject:
    input:
        files=given_files,
    output:
        paths.CHECK,
    log:
        paths.log_of("check_subject"),
    benchmark:
        paths.cost_of("check_subject")
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
