# Muscles: shapes from plastic strains, separation, strains over poses (Wang 2021 chapter 5, Zheng 2022 §4).


rule place_templates:
    input:
        rig=paths.RIG,
        templates=lambda w: template_files(w.subject),
        carried=carried_template,
    output:
        paths.PLACED_TEMPLATES,
    log:
        paths.log_of("place_templates"),
    benchmark:
        paths.cost_of("place_templates")
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
        rig=paths.RIG,
        templates=paths.PLACED_TEMPLATES,
        volume=neutral_volume,
        markers=of_muscle("markers"),
        landmarks=of_muscle("landmarks"),
        labels=labels_of_muscle,
    output:
        paths.FITTED_MUSCLE,
    log:
        paths.log_of("extract_muscle", "muscle"),
    benchmark:
        paths.cost_of("extract_muscle", "muscle")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads_with_maps(
            lambda data: [data.neutral],
            *image_of("{neutral}"),
            "neutral",
            "muscles.names",
        ),
    message:
        "{wildcards.subject}: shape of {wildcards.muscle} in neutral"
    script:
        "../scripts/extract_muscle.py"


rule separate_neutral:
    input:
        rig=paths.RIG,
        muscles=of_muscles(paths.FITTED_MUSCLE),
    output:
        paths.NEUTRAL_MUSCLES,
    log:
        paths.log_of("separate_neutral"),
    benchmark:
        paths.cost_of("separate_neutral")
    threads: 1
    resources:
        mem_mb=at_size("muscle", 2500, 3000),
        runtime=30,
    params:
        dataset=reads("muscles.names"),
        edge=SETTINGS.sizes.muscle,
    message:
        "{wildcards.subject}: separate the muscles in neutral"
    script:
        "../scripts/separate_neutral.py"


# One job for all: each pose starts from the most similar one that is known, and muscles know their neighbours.
rule extract_muscle_shapes:
    input:
        rig=paths.RIG,
        neutral=paths.NEUTRAL_MUSCLES,
        volumes=lambda w: volumes(w.subject, dataset(w.subject).examples),
        registrations=in_poses(paths.REGISTRATION, Role.example),
        flesh=in_flesh(Role.example),
        markers=all_of_muscles("markers"),
        landmarks=all_of_muscles("landmarks"),
        labels=labels_of_examples,
    output:
        paths.MUSCLE_SHAPES,
    log:
        paths.log_of("extract_muscle_shapes"),
    benchmark:
        paths.cost_of("extract_muscle_shapes")
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        dataset=reads_with_maps(
            lambda data: data.examples,
            *image_of("{examples}"),
            "examples",
            "poses.{examples}.markers",
            "poses.{examples}.landmarks",
            "poses.{examples}.labels",
        ),
    message:
        "{wildcards.subject}: shapes of the muscles in the example poses"
    script:
        "../scripts/extract_muscle_shapes.py"


rule separate_muscles:
    input:
        rig=paths.RIG,
        registration=paths.REGISTRATION,
        neutral=paths.NEUTRAL_MUSCLES,
        shapes=paths.MUSCLE_SHAPES,
    output:
        paths.SEPARATED_MUSCLES,
    log:
        paths.log_of("separate_muscles", "pose"),
    benchmark:
        paths.cost_of("separate_muscles", "pose")
    threads: 1
    resources:
        mem_mb=at_size("muscle", 2500, 3000),
        runtime=60,
    message:
        "{wildcards.subject}: separate the muscles of {wildcards.pose}"
    script:
        "../scripts/separate_muscles.py"


rule fit_muscle_strains:
    input:
        rig=paths.RIG,
        neutral=paths.NEUTRAL_MUSCLES,
        shapes=paths.MUSCLE_SHAPES,
        separated=in_poses(paths.SEPARATED_MUSCLES, Role.example),
        flesh=in_flesh(Role.neutral, Role.example),
    output:
        paths.MUSCLE_STRAINS,
    log:
        paths.log_of("fit_muscle_strains", "muscle"),
    benchmark:
        paths.cost_of("fit_muscle_strains", "muscle")
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
        rig=paths.RIG,
        templates=paths.PLACED_TEMPLATES,
        muscles=of_muscles(paths.MUSCLE_STRAINS),
        separated=in_poses(paths.SEPARATED_MUSCLES, Role.example),
        inner=lambda w: muscle_poses(w.subject),
        registrations=in_poses(paths.REGISTRATION, Role.example),
        truth=in_truth(paths.TRUTH),
    output:
        metrics=paths.metrics_of("muscles"),
        table=report(
            paths.table_of("muscles"),
            caption="../report/muscles.rst",
            category="Organs",
            subcategory="{subject}",
        ),
    log:
        paths.log_of("evaluate_muscles"),
    benchmark:
        paths.cost_of("evaluate_muscles")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "muscles.names", "truth", "root"),
        costs=costs_of(
            "place_templates",
            "extract_muscle",
            "separate_neutral",
            "extract_muscle_shapes",
            "separate_muscles",
            "fit_muscle_strains",
        ),
    message:
        "{wildcards.subject}: muscles against truth"
    script:
        "../scripts/evaluate_muscles.py"
