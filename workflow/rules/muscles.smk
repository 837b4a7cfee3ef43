# Muscles: shapes from plastic strains, separation, strains over poses (003 chapter 5, 000 section 4).


rule extract_muscle:
    input:
        dataset=lambda w: dataset_file(w.subject),
        rig="results/{subject}/rig.h5",
        volume=lambda w: dataset(w.subject).path(
            dataset(w.subject).poses[neutral(w.subject)].volume
        ),
        templates=lambda w: template_files(w.subject),
    output:
        "results/{subject}/muscles/{muscle}/neutral.h5",
    log:
        "results/{subject}/logs/extract_muscle/{muscle}.log",
    benchmark:
        "results/{subject}/benchmarks/extract_muscle/{muscle}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: shape of {wildcards.muscle} in neutral"
    script:
        "../scripts/extract_muscle.py"


rule extract_muscle_shape:
    input:
        dataset=lambda w: dataset_file(w.subject),
        rig="results/{subject}/rig.h5",
        volume=of_pose("volume"),
        neutral="results/{subject}/muscles/{muscle}/neutral.h5",
        registration="results/{subject}/registration/{pose}.h5",
    output:
        "results/{subject}/muscles/{muscle}/shapes/{pose}.h5",
    log:
        "results/{subject}/logs/extract_muscle_shape/{muscle}/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/extract_muscle_shape/{muscle}/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: shape of {wildcards.muscle} in {wildcards.pose}"
    script:
        "../scripts/extract_muscle_shape.py"


rule separate_muscles:
    input:
        dataset=lambda w: dataset_file(w.subject),
        rig="results/{subject}/rig.h5",
        registration="results/{subject}/registration/{pose}.h5",
        shapes=lambda w: [
            f"results/{w.subject}/muscles/{m}/"
            + ("neutral.h5" if w.pose == neutral(w.subject) else f"shapes/{w.pose}.h5")
            for m in dataset(w.subject).muscles
        ],
    output:
        "results/{subject}/muscle_separation/{pose}.h5",
    log:
        "results/{subject}/logs/separate_muscles/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/separate_muscles/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: separate the muscles of {wildcards.pose}"
    script:
        "../scripts/separate_muscles.py"


rule fit_muscle_strains:
    input:
        dataset=lambda w: dataset_file(w.subject),
        rig="results/{subject}/rig.h5",
        neutral="results/{subject}/muscles/{muscle}/neutral.h5",
        separated=in_poses(
            "results/{subject}/muscle_separation/{pose}.h5", Role.neutral, Role.example
        ),
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
    message:
        "{wildcards.subject}: plastic strains of {wildcards.muscle} over the poses"
    script:
        "../scripts/fit_muscle_strains.py"


rule evaluate_muscles:
    input:
        dataset=lambda w: dataset_file(w.subject),
        muscles=lambda w: expand(
            "results/{subject}/muscles/{muscle}/strains.h5",
            muscle=dataset(w.subject).muscles,
            allow_missing=True,
        ),
        separated=in_poses(
            "results/{subject}/muscle_separation/{pose}.h5", Role.example
        ),
        inner=in_poses("results/{subject}/poses/{pose}/inner.h5", Role.example),
    output:
        "results/{subject}/metrics/muscles.json",
    log:
        "results/{subject}/logs/evaluate_muscles/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_muscles/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: muscles against truth"
    script:
        "../scripts/evaluate_muscles.py"
