# The coupled hand: poses of one body of all tissues, and what a scanner, a person and a truth would give of it.

TRUTH_ORDER = {"toy": 1, "full": 2}  # linear or quadratic tets
TRUTH_MEMORY = {"toy": 4000, "full": 12000}  # MiB


rule coupled_body:
    input:
        template=paths.TEMPLATE,
        subject=paths.TEMPLATE_SUBJECT,
    output:
        paths.COUPLED_BODY,
    log:
        paths.log_of("coupled_body"),
    benchmark:
        paths.cost_of("coupled_body")
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads_whole("name", "generator", "anatomy", "proportions"),
    message:
        "{wildcards.subject}: the template as one body whose joints can open"
    script:
        "../scripts/coupled_body.py"


rule coupled_pose:
    input:
        body=paths.COUPLED_BODY,
        subject=paths.TEMPLATE_SUBJECT,
    output:
        paths.COUPLED_POSE,
    log:
        paths.log_of("coupled_pose", "pose"),
    benchmark:
        paths.cost_of("coupled_pose", "pose")
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=lambda w: TRUTH_MEMORY[SETTINGS.truth],
        runtime=120,
    params:
        dataset=reads_whole("name", "generator", "anatomy", "proportions"),
        order=lambda w: TRUTH_ORDER[SETTINGS.truth],
    message:
        "{wildcards.subject}: equilibrium of the coupled body in {wildcards.pose}"
    script:
        "../scripts/coupled_pose.py"


rule coupled_images:
    input:
        body=paths.COUPLED_BODY,
        subject=paths.TEMPLATE_SUBJECT,
        positions=paths.COUPLED_POSE,
    output:
        volume=paths.DATA_VOLUME,
        scan=paths.DATA_SCAN,
        truth=paths.TRUTH,
        bones=paths.TRUE_BONES,
        marrow=paths.TRUE_MARROW,
    log:
        paths.log_of("coupled_images", "pose"),
    benchmark:
        paths.cost_of("coupled_images", "pose")
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=3000,
        runtime=20,
    params:
        dataset=reads_whole(
            "name",
            "generator",
            "anatomy",
            "proportions",
            "hand",
            "seed",
            "scanner",
            "images",
            "truth",
            "root",
            "poses.{pose}.volume",
            "poses.{pose}.scan",
            "bones.*.label",
            "nails.*.bone",
        ),
        order=lambda w: TRUTH_ORDER[SETTINGS.truth],
    message:
        "{wildcards.subject}: image, scan and truth of {wildcards.pose}"
    script:
        "../scripts/coupled_images.py"


rule coupled_templates:
    input:
        template=paths.TEMPLATE,
        body=paths.COUPLED_BODY,
        subject=paths.TEMPLATE_SUBJECT,
        positions=in_neutral(paths.COUPLED_POSE),
    output:
        directory(paths.DATA_TEMPLATES),
        directory(paths.DATA_CURVES),
    log:
        paths.log_of("coupled_templates"),
    benchmark:
        paths.cost_of("coupled_templates")
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        dataset=reads_whole(
            "name",
            "generator",
            "anatomy",
            "proportions",
            "hand",
            "seed",
            "root",
            "neutral",
            "bones.*.template",
            "muscles.*.template",
            "muscles.*.attachments",
            "ligaments.*.template",
            "ligaments.*.attachments",
            "tendons.*.path",
            "nails",
        ),
        order=lambda w: TRUTH_ORDER[SETTINGS.truth],
    message:
        "{wildcards.subject}: templates, tendon curves and nails"
    script:
        "../scripts/coupled_templates.py"


rule evaluate_truth:
    input:
        body=paths.COUPLED_BODY,
        subject=paths.TEMPLATE_SUBJECT,
        positions=in_poses(paths.COUPLED_POSE),
    output:
        paths.metrics_of("truth"),
    log:
        paths.log_of("evaluate_truth"),
    benchmark:
        paths.cost_of("evaluate_truth")
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=lambda w: TRUTH_MEMORY[SETTINGS.truth],
        runtime=lambda w: {"toy": 20, "full": 120}[SETTINGS.truth],
    params:
        dataset=reads_whole("name", "generator", "anatomy", "proportions"),
        order=lambda w: TRUTH_ORDER[SETTINGS.truth],
        costs=costs_of("coupled_pose"),
    message:
        "{wildcards.subject}: checks of the coupled truth by itself"
    script:
        "../scripts/evaluate_truth.py"


# The finger whose tissues slide: bodies, their poses, and what a scanner, a person and a truth would give of them.


rule sliding_body:
    output:
        paths.COUPLED_BODY,
    log:
        paths.log_of("sliding_body"),
    benchmark:
        paths.cost_of("sliding_body")
    wildcard_constraints:
        subject=SLIDING,
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    message:
        "{wildcards.subject}: bodies that slide on one another"
    script:
        "../scripts/sliding_body.py"


rule sliding_pose:
    input:
        body=paths.COUPLED_BODY,
        neutral=where_neutral_is,
    output:
        paths.COUPLED_POSE,
    log:
        paths.log_of("sliding_pose", "pose"),
    benchmark:
        paths.cost_of("sliding_pose", "pose")
    wildcard_constraints:
        subject=SLIDING,
    threads: 1
    resources:
        mem_mb=3000,
        runtime=60,
    message:
        "{wildcards.subject}: equilibrium of the bodies in {wildcards.pose}"
    script:
        "../scripts/sliding_pose.py"


rule sliding_images:
    input:
        body=paths.COUPLED_BODY,
        positions=paths.COUPLED_POSE,
    output:
        volume=paths.DATA_VOLUME,
        seeds=paths.DATA_SEEDS,
        scan=paths.DATA_SCAN,
        truth=paths.TRUTH,
        bones=paths.TRUE_BONES,
        marrow=paths.TRUE_MARROW,
    log:
        paths.log_of("sliding_images", "pose"),
    benchmark:
        paths.cost_of("sliding_images", "pose")
    wildcard_constraints:
        subject=SLIDING,
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=reads_whole(
            "name",
            "generator",
            "seed",
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
        "../scripts/sliding_images.py"


rule evaluate_sliding:
    input:
        body=paths.COUPLED_BODY,
        neutral=in_neutral(paths.COUPLED_POSE),
        positions=in_poses(paths.COUPLED_POSE),
    output:
        paths.metrics_of("truth"),
    log:
        paths.log_of("evaluate_sliding"),
    benchmark:
        paths.cost_of("evaluate_sliding")
    wildcard_constraints:
        subject=SLIDING,
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        costs=costs_of("sliding_pose"),
    message:
        "{wildcards.subject}: checks of the sliding truth by itself"
    script:
        "../scripts/evaluate_sliding.py"
