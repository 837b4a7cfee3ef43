# Registered bones to a kinematic rig (Wang 2019 §4).


rule fit_rig:
    input:
        neutral=lambda w: f"results/{w.subject}/segmentation/{neutral(w.subject)}/surfaces.h5",
        registrations=in_poses("results/{subject}/registration/{pose}.h5"),
    output:
        rig="results/{subject}/rig.h5",
        metrics="results/{subject}/metrics/rig.json",
        table=report(
            "results/{subject}/tables/rig.json",
            caption="../report/rig.rst",
            category="Bones",
            subcategory="{subject}",
        ),
        limits=report(
            "results/{subject}/tables/limits.json",
            caption="../report/limits.rst",
            category="Bones",
            subcategory="{subject}",
        ),
    log:
        "results/{subject}/logs/fit_rig/all.log",
    benchmark:
        "results/{subject}/benchmarks/fit_rig/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        organs=lambda w: has_organs(w.subject),
        dataset=reads("name", "poses.*.role", "bones.names", "joints", "truth", "root"),
    message:
        "{wildcards.subject}: fit the rig"
    script:
        "../scripts/fit_rig.py"
