# Template hands: all organs on the bones of a generated hand, from one file of curves (Abdrashitov 2021), and those of real anatomy.

HAND_CURVES = "config/anatomy/hand.yaml"
HAND_EDGES = {"bone": 1.6, "skin": 2.8, "fat": 4}  # mm


rule template_hand:
    input:
        curves=HAND_CURVES,
    output:
        tissue=paths.TEMPLATE,
        subject=paths.TEMPLATE_SUBJECT,
        metrics=paths.metrics_of("anatomy"),
    log:
        paths.log_of("template_hand"),
    benchmark:
        paths.cost_of("template_hand")
    wildcard_constraints:
        subject=with_template("curves"),
    threads: 1
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        dataset=reads_whole("proportions"),
        edges=HAND_EDGES,
    message:
        "{wildcards.subject}: template of all organs"
    script:
        "../scripts/template_hand.py"


rule zanatomy_hand:
    output:
        tissue=paths.TEMPLATE,
        subject=paths.TEMPLATE_SUBJECT,
        metrics=paths.metrics_of("anatomy"),
        repairs=paths.table_of("repairs"),
    log:
        paths.log_of("zanatomy_hand"),
    benchmark:
        paths.cost_of("zanatomy_hand")
    wildcard_constraints:
        subject=with_template("surfaces"),
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
