# Figures of the whole build and the report.


rule report:
    input:
        rig=paths.RIG,
        metrics=lambda w: expand(
            paths.METRICS, subject=w.subject, stage=report_stages(w.subject)
        ),
        tables=lambda w: report_tables(w.subject),
        poses=lambda w: report_poses(w.subject),
        volumes=lambda w: volumes(w.subject, poses_in_report(w.subject)),
        scans=lambda w: scans(w.subject, poses_in_report(w.subject)),
        truth=in_truth(paths.TRUTH),
        chunks=chunks_of_scenes,
        exports=lambda w: expand(
            paths.SCENE_GLB,
            scene=SETTINGS.scenes,
            allow_missing=True,
        ),
    output:
        page=report(
            paths.REPORT,
            caption="../report/report.rst",
            category="Pictures and tables",
            subcategory="{subject}",
        ),
        pictures=report(
            directory(paths.PICTURES),
            patterns=["{of}-{shows}.png"],
            caption="../report/pictures.rst",
            category="Pictures",
            subcategory="{subject}",
            labels={"pose or scene": "{of}", "shows": "{shows}"},
        ),
    log:
        paths.log_of("report"),
    benchmark:
        paths.cost_of("report")
    threads: 1
    resources:
        mem_mb=2500,
        runtime=30,
    params:
        dataset=reads(
            "name",
            "hand",
            "generator",
            "seed",
            "truth",
            *image_of("*"),
            "poses.*.role",
            "poses.*.scan",
            "bones.names",
            "joints.names",
            "muscles.names",
            "ligaments.names",
            "tendons.names",
            "nails.names",
        ),
        scenes=lambda w: {
            s: expand(
                paths.SCENE_CHUNK,
                subject=w.subject,
                scene=s,
                chunk=chunks(w.subject, s),
            )
            for s in SETTINGS.scenes
        },
        jobs=lambda w: str(paths.at(paths.COSTS, subject=w.subject)),
        logs=lambda w: str(paths.at(paths.LOGS, subject=w.subject)),
        benchmarks=paths.benchmark_of("fem.json"),  # shown where someone has made it
        settings=SETTINGS.shown,
    message:
        "{wildcards.subject}: report"
    script:
        "../scripts/report.py"


rule evaluate_poses:
    input:
        simulated=lambda w: report_poses(w.subject),
        fits=lambda w: fat_fits(w.subject),
    output:
        metrics=paths.metrics_of("poses"),
        table=paths.table_of("poses"),
    log:
        paths.log_of("evaluate_poses"),
    benchmark:
        paths.cost_of("evaluate_poses")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: what solvers say of the scanned poses"
    script:
        "../scripts/evaluate_poses.py"


rule evaluate_build:
    input:
        report=paths.REPORT,
    output:
        paths.metrics_of("build"),
    log:
        paths.log_of("evaluate_build"),
    benchmark:
        paths.cost_of("evaluate_build")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        jobs=lambda w: str(paths.at(paths.COSTS, subject=w.subject)),
    message:
        "{wildcards.subject}: time and memory of the build"
    script:
        "../scripts/evaluate_build.py"
