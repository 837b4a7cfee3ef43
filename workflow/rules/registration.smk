# Neutral marrow into each pose (Wang 2019 §3.1).


rule register_bones:
    input:
        neutral=lambda w: f"results/{w.subject}/segmentation/{neutral(w.subject)}/surfaces.h5",
        target="results/{subject}/segmentation/{pose}/surfaces.h5",
    output:
        "results/{subject}/registration/{pose}.h5",
    log:
        "results/{subject}/logs/register_bones/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/register_bones/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads(
            "neutral",
            "bones.names",
            "joints.*.parent",
            "joints.*.child",
            "joints.*.angles",
            "joints.*.axis_hints",
        ),
    message:
        "{wildcards.subject}: register the bones of {wildcards.pose}"
    script:
        "../scripts/register_bones.py"


rule evaluate_registration:
    input:
        neutral=lambda w: f"results/{w.subject}/segmentation/{neutral(w.subject)}/surfaces.h5",
        registrations=in_poses("results/{subject}/registration/{pose}.h5"),
    output:
        metrics="results/{subject}/metrics/registration.json",
        table=report(
            "results/{subject}/tables/registration.json",
            caption="../report/registration.rst",
            category="Bones",
            subcategory="{subject}",
        ),
    log:
        "results/{subject}/logs/evaluate_registration/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_registration/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.names", "neutral", "bones.names", "truth", "root"),
    message:
        "{wildcards.subject}: registration against truth"
    script:
        "../scripts/evaluate_registration.py"
