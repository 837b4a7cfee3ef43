# The neutral image in motion, with the frames of a scene and into scanned poses (Zheng 2022 Figs. 1, 2, 32, 33); a
# rigged hand; the textured scan; models of the skeleton; strains and stresses; movies.


rule move_images:
    input:
        rig=paths.RIG,
        volume=neutral_volume,
        chunks=scene_chunks,
    output:
        directory(paths.SCENE_IMAGES),
    log:
        paths.log_of("move_images", "scene"),
    benchmark:
        paths.cost_of("move_images", "scene")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=60,
    params:
        dataset=reads("neutral", *image_of("{neutral}")),
    message:
        "{wildcards.subject}: {wildcards.scene}, the neutral image in motion"
    script:
        "../scripts/move_images.py"


rule move_image:
    input:
        rig=paths.RIG,
        inner=paths.POSE_INNER,
        skin=paths.POSE_SKIN,
        passive=paths.POSE_PASSIVE_SKIN,
        neutral=neutral_volume,
        volume=of_pose("volume"),
    output:
        volume=paths.MOVED_IMAGE,
        slices=report(
            paths.MOVED_SLICES,
            caption="../report/moved.rst",
            category="Pictures",
            subcategory="{subject}",
            labels={"pose or scene": "{pose}", "shows": "moved image"},
        ),
        table=paths.MOVED_FIGURES,
    log:
        paths.log_of("move_image", "pose"),
    benchmark:
        paths.cost_of("move_image", "pose")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        dataset=reads(
            "neutral", *image_of("{neutral}"), *image_of(), "poses.{pose}.role"
        ),
    message:
        "{wildcards.subject}: the neutral image moved into {wildcards.pose}"
    script:
        "../scripts/move_image.py"


rule evaluate_images:
    input:
        tables=lambda w: expand(
            paths.MOVED_FIGURES,
            subject=w.subject,
            pose=poses_with_moved_images(w.subject),
        ),
    output:
        metrics=paths.metrics_of("images"),
        table=paths.table_of("images"),
    log:
        paths.log_of("evaluate_images"),
    benchmark:
        paths.cost_of("evaluate_images")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        costs=costs_of("move_image"),
    message:
        "{wildcards.subject}: how alike moved and scanned images are"
    script:
        "../scripts/evaluate_images.py"


rule export_rigged:
    input:
        rig=paths.RIG,
        chunks=scene_chunks,
    output:
        paths.SCENE_RIGGED,
    log:
        paths.log_of("export_rigged", "scene"),
    benchmark:
        paths.cost_of("export_rigged", "scene")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: {wildcards.scene} as a skeleton with skins and corrective shapes"
    script:
        "../scripts/export_rigged.py"


rule export_scan:
    input:
        rig=paths.RIG,
        chunks=scene_chunks,
        scan=neutral_scan_file,
        aligned=neutral_scan,
        textures=textures_of_scan,
    output:
        paths.SCENE_SCAN,
    log:
        paths.log_of("export_scan", "scene"),
    benchmark:
        paths.cost_of("export_scan", "scene")
    threads: 1
    resources:
        mem_mb=4000,
        runtime=20,
    params:
        dataset=reads("hand"),
        scene=reads_scene("delta_mush"),
    message:
        "{wildcards.subject}: {wildcards.scene}, the scan with its texture in motion"
    script:
        "../scripts/export_scan.py"


rule export_skeleton:
    input:
        rig=paths.RIG,
        chunks=scene_chunks,
        tendons=tendons_of_scene,
    output:
        folder=directory(paths.SCENE_SKELETON),
        metrics=paths.metrics_of("skeleton-{scene}"),
    log:
        paths.log_of("export_skeleton", "scene"),
    benchmark:
        paths.cost_of("export_skeleton", "scene")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: {wildcards.scene}, skeleton and tendons for MuJoCo and OpenSim"
    script:
        "../scripts/export_skeleton.py"


rule export_mechanics:
    input:
        rig=paths.RIG,
        chunks=scene_chunks,
        layers=simulated_files,
    output:
        directory(paths.SCENE_MECHANICS),
    log:
        paths.log_of("export_mechanics", "scene"),
    benchmark:
        paths.cost_of("export_mechanics", "scene")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=10,
    params:
        dataset=of_layers(lambda w: scene(w.scene).needed),
        scene=reads_scene("layers"),
    message:
        "{wildcards.subject}: {wildcards.scene}, strains and stresses"
    script:
        "../scripts/export_mechanics.py"


rule render_movie:
    input:
        rig=paths.RIG,
        chunks=scene_chunks,
    output:
        report(
            paths.SCENE_MOVIE,
            caption="../report/movie.rst",
            category="Pictures",
            subcategory="{subject}",
            labels={"pose or scene": "{scene}", "shows": "movie"},
        ),
    log:
        paths.log_of("render_movie", "scene"),
    benchmark:
        paths.cost_of("render_movie", "scene")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=120,
    params:
        dataset=reads("hand"),
    message:
        "{wildcards.subject}: {wildcards.scene} as a movie"
    script:
        "../scripts/render_movie.py"


rule render_volumes:
    input:
        rig=paths.RIG,
        chunks=scene_chunks,
        images=paths.SCENE_IMAGES,
    output:
        anatomy=report(
            paths.SCENE_ANATOMY_MOVIE,
            caption="../report/movie_of_image.rst",
            category="Pictures",
            subcategory="{subject}",
            labels={"pose or scene": "{scene}", "shows": "movie of the image"},
        ),
        fat=report(
            paths.SCENE_FAT_MOVIE,
            caption="../report/movie_of_fat.rst",
            category="Pictures",
            subcategory="{subject}",
            labels={"pose or scene": "{scene}", "shows": "movie of the fat"},
        ),
    log:
        paths.log_of("render_volumes", "scene"),
    benchmark:
        paths.cost_of("render_volumes", "scene")
    threads: 1
    resources:
        mem_mb=3000,
        runtime=120,
    params:
        dataset=reads("hand"),
    message:
        "{wildcards.subject}: {wildcards.scene}, the neutral image in motion as movies of volumes"
    script:
        "../scripts/render_volumes.py"
