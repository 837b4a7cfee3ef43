# The template hand: all organs on the bones of a generated hand, from one file of curves (002).

HAND_CURVES = "config/anatomy/hand.yaml"
HAND_EDGES = {"bone": 1.6, "skin": 2.8, "fat": 4}  # mm


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
        subject=f"phantom-hand(?:-seeded)?|{COUPLED}",
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
