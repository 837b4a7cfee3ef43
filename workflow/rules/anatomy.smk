# Template hands: all organs on the bones of a generated hand, from one file of curves (002), and those of real anatomy.

HAND_CURVES = "config/anatomy/hand.yaml"
HAND_EDGES = {"bone": 1.6, "skin": 2.8, "fat": 4}  # mm
CURVED = f"phantom-hand(?:-seeded)?|{generated_by('phantom-hand-complete')}"


rule template_hand:
    input:
        curves=HAND_CURVES,
    output:
        tissue="results/{subject}/anatomy/template.h5",
        subject="results/{subject}/anatomy/subject.h5",
        metrics="results/{subject}/metrics/anatomy.json",
    log:
        "results/{subject}/logs/template_hand/all.log",
    benchmark:
        "results/{subject}/benchmarks/template_hand/all.tsv"
    wildcard_constraints:
        subject=CURVED,
    threads: 1
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        edges=HAND_EDGES,
    message:
        "{wildcards.subject}: template of all organs"
    script:
        "../scripts/template_hand.py"


rule zanatomy_hand:
    output:
        tissue="results/{subject}/anatomy/template.h5",
        subject="results/{subject}/anatomy/subject.h5",
        metrics="results/{subject}/metrics/anatomy.json",
        repairs="results/{subject}/tables/repairs.json",
    log:
        "results/{subject}/logs/zanatomy_hand/all.log",
    benchmark:
        "results/{subject}/benchmarks/zanatomy_hand/all.tsv"
    wildcard_constraints:
        subject=generated_by("zanatomy-hand"),
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    params:
        dataset=reads_whole("name", "anatomy"),
        edges=HAND_EDGES,
    message:
        "{wildcards.subject}: template of real organs"
    script:
        "../scripts/zanatomy_hand.py"
