# Muscles: shapes from plastic strains, separation, strains over poses (Wang 2021 chapter 5, Zheng 2022 §4).


rule place_templates:
    input:
        rig="results/{subject}/rig.h5",
        templates=lambda w: template_files(w.subject),
    output:
        "results/{subject}/templates.h5",
    log:
        "results/{subject}/logs/place_templates/all.log",
    benchmark:
        "results/{subject}/benchmarks/place_templates/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("root", "bones.*.template", "muscles", "ligaments"),
    message:
        "{wildcards.subject}: place the templates of muscles and ligaments on the bones"
    script:
        "../scripts/place_templates.py"


rule extract_muscle:
    input:
        rig="results/{subject}/rig.h5",
        templates="results/{subject}/templates.h5",
        volume=neutral_volume,
        markers=of_muscle("markers"),
        landmarks=of_muscle("landmarks"),
    output:
        "results/{subject}/muscles/{muscle}/fitted.h5",
    log:
        "results/{subject}/logs/extract_muscle/{muscle}.log",
    benchmark:
        "results/{subject}/benchmarks/extract_muscle/{muscle}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads(*image_of("{neutral}"), "neutral", "muscles.names"),
    message:
        "{wildcards.subject}: shape of {wildcards.muscle} in neutral"
    script:
        "../scripts/extract_muscle.py"


rule separate_neutral:
    input:
        rig="results/{subject}/rig.h5",
        muscles=of_muscles("results/{subject}/muscles/{muscle}/fitted.h5"),
    output:
        "results/{subject}/muscles/neutral.h5",
    log:
        "results/{subject}/logs/separate_neutral/all.log",
    benchmark:
        "results/{subject}/benchmarks/separate_neutral/all.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        dataset=reads("muscles.names"),
        edge=SETTINGS.edges.muscle,
    message:
        "{wildcards.subject}: separate the muscles in neutral"
    script:
        "../scripts/separate_neutral.py"


# One job for all: each pose starts from the most similar one that is known, and muscles know their neighbours.
rule extract_muscle_shapes:
    input:
        rig="results/{subject}/rig.h5",
        neutral="results/{subject}/muscles/neutral.h5",
        volumes=lambda w: [
            dataset(w.subject).path(dataset(w.subject).poses[p].volume)
            for p in dataset(w.subject).examples
        ],
        registrations=in_poses("results/{subject}/registration/{pose}.h5", Role.example),
        flesh=in_flesh(Role.example),
        markers=all_of_muscles("markers"),
        landmarks=all_of_muscles("landmarks"),
    output:
        "results/{subject}/muscles/shapes.h5",
    log:
        "results/{subject}/logs/extract_muscle_shapes/all.log",
    benchmark:
        "results/{subject}/benchmarks/extract_muscle_shapes/all.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        dataset=reads(
            *image_of("{examples}"),
            "examples",
            "poses.{examples}.markers",
            "poses.{examples}.landmarks",
        ),
    message:
        "{wildcards.subject}: shapes of the muscles in the example poses"
    script:
        "../scripts/extract_muscle_shapes.py"


rule separate_muscles:
    input:
        rig="results/{subject}/rig.h5",
        registration="results/{subject}/registration/{pose}.h5",
        neutral="results/{subject}/muscles/neutral.h5",
        shapes="results/{subject}/muscles/shapes.h5",
    output:
        "results/{subject}/muscle_separation/{pose}.h5",
    log:
        "results/{subject}/logs/separate_muscles/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/separate_muscles/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=60,
    message:
        "{wildcards.subject}: separate the muscles of {wildcards.pose}"
    script:
        "../scripts/separate_muscles.py"


rule fit_muscle_strains:
    input:
        rig="results/{subject}/rig.h5",
        neutral="results/{subject}/muscles/neutral.h5",
        shapes="results/{subject}/muscles/shapes.h5",
        separated=in_poses(
            "results/{subject}/muscle_separation/{pose}.h5", Role.example
        ),
        flesh=in_flesh(Role.neutral, Role.example),
    output:
        "results/{subject}/muscles/{muscle}/strains.h5",
    log:
        "results/{subject}/logs/fit_muscle_strains/{muscle}.log",
    benchmark:
        "results/{subject}/benchmarks/fit_muscle_strains/{muscle}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=20,
    params:
        dataset=reads("neutral", "examples", "muscle_interpolation"),
    message:
        "{wildcards.subject}: plastic strains of {wildcards.muscle} over the poses"
    script:
        "../scripts/fit_muscle_strains.py"


rule evaluate_muscles:
    input:
        rig="results/{subject}/rig.h5",
        templates="results/{subject}/templates.h5",
        muscles=of_muscles("results/{subject}/muscles/{muscle}/strains.h5"),
        separated=in_poses(
            "results/{subject}/muscle_separation/{pose}.h5", Role.example
        ),
        inner=lambda w: muscle_poses(w.subject),
    output:
        metrics="results/{subject}/metrics/muscles.json",
        table=report(
            "results/{subject}/tables/muscles.json",
            caption="../report/muscles.rst",
            category="Organs",
            subcategory="{subject}",
        ),
    log:
        "results/{subject}/logs/evaluate_muscles/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_muscles/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "muscles.names", "truth", "root"),
    message:
        "{wildcards.subject}: muscles against truth"
    script:
        "../scripts/evaluate_muscles.py"
