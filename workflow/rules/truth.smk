# The coupled hand: poses of one body of all tissues, and what a scanner, a person and a truth would give of it.

TRUTH_ORDER = {"toy": 1, "full": 2}  # linear or quadratic tets
TRUTH_MEMORY = {"toy": 4000, "full": 12000}  # MiB


rule coupled_body:
    input:
        template="results/{subject}/anatomy/template.h5",
        subject="results/{subject}/anatomy/subject.h5",
    output:
        "results/{subject}/anatomy/coupled.h5",
    log:
        "results/{subject}/logs/coupled_body/all.log",
    benchmark:
        "results/{subject}/benchmarks/coupled_body/all.tsv"
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads_whole("name", "generator", "anatomy"),
    message:
        "{wildcards.subject}: the template as one body whose joints can open"
    script:
        "../scripts/coupled_body.py"


rule coupled_pose:
    input:
        body="results/{subject}/anatomy/coupled.h5",
        subject="results/{subject}/anatomy/subject.h5",
    output:
        "results/{subject}/coupled/{pose}.h5",
    log:
        "results/{subject}/logs/coupled_pose/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/coupled_pose/{pose}.tsv"
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=lambda w: TRUTH_MEMORY[SETTINGS.truth],
        runtime=120,
    params:
        dataset=reads_whole("name", "generator", "anatomy"),
        order=lambda w: TRUTH_ORDER[SETTINGS.truth],
    message:
        "{wildcards.subject}: equilibrium of the coupled body in {wildcards.pose}"
    script:
        "../scripts/coupled_pose.py"


rule coupled_images:
    input:
        body="results/{subject}/anatomy/coupled.h5",
        subject="results/{subject}/anatomy/subject.h5",
        positions="results/{subject}/coupled/{pose}.h5",
    output:
        volume="results/{subject}/data/volumes/{pose}.nii.gz",
        scan="results/{subject}/data/scans/{pose}.ply",
        truth="results/{subject}/data/truth/{pose}.h5",
        bones="results/{subject}/data/truth/{pose}.bones.nii.gz",
        marrow="results/{subject}/data/truth/{pose}.marrow.nii.gz",
    log:
        "results/{subject}/logs/coupled_images/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/coupled_images/{pose}.tsv"
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
            "seed",
            "scanner",
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
        template="results/{subject}/anatomy/template.h5",
        body="results/{subject}/anatomy/coupled.h5",
        subject="results/{subject}/anatomy/subject.h5",
        positions=lambda w: f"results/{w.subject}/coupled/{neutral(w.subject)}.h5",
    output:
        directory("results/{subject}/data/templates"),
        directory("results/{subject}/data/curves"),
    log:
        "results/{subject}/logs/coupled_templates/all.log",
    benchmark:
        "results/{subject}/benchmarks/coupled_templates/all.tsv"
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
        body="results/{subject}/anatomy/coupled.h5",
        subject="results/{subject}/anatomy/subject.h5",
        positions=in_poses("results/{subject}/coupled/{pose}.h5"),
    output:
        "results/{subject}/metrics/truth.json",
    log:
        "results/{subject}/logs/evaluate_truth/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_truth/all.tsv"
    wildcard_constraints:
        subject=COUPLED,
    threads: 1
    resources:
        mem_mb=lambda w: TRUTH_MEMORY[SETTINGS.truth],
        runtime=lambda w: {"toy": 20, "full": 120}[SETTINGS.truth],
    params:
        dataset=reads_whole("name", "generator", "anatomy"),
        order=lambda w: TRUTH_ORDER[SETTINGS.truth],
    message:
        "{wildcards.subject}: what the coupled truth says of itself"
    script:
        "../scripts/evaluate_truth.py"
