# How far each point of a simulated hand is expected to be off, for scenes that ask for it.


rule learn_deviations:
    input:
        rig=paths.RIG,
        rig_table=paths.table_of("rig"),
        volume=neutral_volume,
        registrations=in_poses(paths.REGISTRATION),
        tendons=of_layer("tendons", lambda w: layer_files(w.subject, ["tendons"])),
        posed_tendons=of_layer("tendons", posed_tendons),
        templates=of_layer("muscles", lambda w: paths.at(paths.PLACED_TEMPLATES, **w)),
        muscles=of_layer("muscles", of_muscles(paths.MUSCLE_STRAINS)),
        separated=of_layer("muscles", in_poses(paths.SEPARATED_MUSCLES, Role.example)),
        inner=layers_in_poses(Role.example),
        fat=of_layer("fat", lambda w: paths.at(paths.FAT, **w)),
        strains=of_layer("fat", lambda w: paths.at(paths.FAT_STRAINS, **w)),
        skins=of_layer("fat", in_poses(paths.POSE_SKIN, Role.example)),
        passive=of_layer("fat", in_poses(paths.POSE_PASSIVE_SKIN, Role.example)),
        scans=of_layer("fat", lambda w: scans(w.subject, dataset(w.subject).examples)),
    output:
        paths.DEVIATIONS,
    log:
        paths.log_of("learn_deviations"),
    benchmark:
        paths.cost_of("learn_deviations")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        dataset=reads("neutral", "examples", "poses.*.role", *image_of("{neutral}")),
    message:
        "{wildcards.subject}: how far bones, tendons, muscles and skin are expected to be off"
    script:
        "../scripts/learn_deviations.py"


rule state_deviations:
    input:
        rig=paths.RIG,
        deviations=paths.DEVIATIONS,
        chunks=scene_chunks,
    output:
        stated=paths.SCENE_STATED,
        vtk=directory(paths.SCENE_DEVIATIONS),
    log:
        paths.log_of("state_deviations", "scene"),
    benchmark:
        paths.cost_of("state_deviations", "scene")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    message:
        "{wildcards.subject}: {wildcards.scene}, how far each point is expected to be off"
    script:
        "../scripts/state_deviations.py"


rule evaluate_deviations:
    input:
        rig=paths.RIG,
        deviations=paths.DEVIATIONS,
        skin=of_layer("fat", lambda w: paths.at(paths.SKIN, **w)),
        inner=layers_in_poses(Role.example, Role.heldout),
        skins=of_layer(
            "fat",
            lambda w: expand(
                paths.POSE_SKIN, subject=w.subject, pose=scanned(w.subject)
            ),
        ),
        truth=in_truth(paths.TRUTH),
    output:
        metrics=paths.metrics_of("deviations"),
        table=paths.table_of("deviations"),
    log:
        paths.log_of("evaluate_deviations"),
    benchmark:
        paths.cost_of("evaluate_deviations")
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "truth", "root"),
    message:
        "{wildcards.subject}: stated deviations beside true errors"
    script:
        "../scripts/evaluate_deviations.py"
