# Fat and skin: mesh, constraints, nails, plastic strains (Zheng 2022 §7), and the single soft tissue of Wang 2019.


rule extract_skin:
    input:
        volume=of_pose("volume"),
        rig=paths.RIG,
        neutral=neutral_skin,
    output:
        surface=paths.VOLUME_SKIN,
        figures=paths.VOLUME_SKIN_FIGURES,
    log:
        paths.log_of("extract_skin", "pose"),
    benchmark:
        paths.cost_of("extract_skin", "pose")
    threads: 1
    resources:
        mem_mb=6000,
        runtime=20,
    params:
        dataset=reads(*image_of(), "neutral"),
    message:
        "{wildcards.subject}: skin of {wildcards.pose} from its volume"
    script:
        "../scripts/extract_skin.py"


rule make_skin:
    input:
        scan=neutral_scan,
        nails=lambda w: nail_files(w.subject),
        carried=carried_template,
        from_volume=neutral_from_volume,
    output:
        paths.SKIN,
    log:
        paths.log_of("make_skin"),
    benchmark:
        paths.cost_of("make_skin")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("root", "nails", "root_bone"),
        edge=SETTINGS.sizes.skin,
    message:
        "{wildcards.subject}: neutral skin from its scan"
    script:
        "../scripts/make_skin.py"


rule mesh_fat:
    input:
        rig=paths.RIG,
        inner=in_neutral(paths.POSE_INNER),
        skin=paths.SKIN,
    output:
        paths.FAT,
    log:
        paths.log_of("mesh_fat"),
    benchmark:
        paths.cost_of("mesh_fat")
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        edge=SETTINGS.sizes.fat,
    message:
        "{wildcards.subject}: tetrahedra between the inner surface and the skin"
    script:
        "../scripts/mesh_fat.py"


rule mesh_soft_tissue:
    input:
        rig=paths.RIG,
        skin=paths.SKIN,
    output:
        paths.SOFT_TISSUE,
    log:
        paths.log_of("mesh_soft_tissue"),
    benchmark:
        paths.cost_of("mesh_soft_tissue")
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=reads("neutral", "joints.*.parent", "joints.*.child"),
        edge=SETTINGS.sizes.fat,
    message:
        "{wildcards.subject}: one soft tissue between the bones and the skin"
    script:
        "../scripts/mesh_soft_tissue.py"


use rule mesh_soft_tissue as mesh_flesh with:
    output:
        paths.FLESH,
    log:
        paths.log_of("mesh_flesh"),
    benchmark:
        paths.cost_of("mesh_flesh")
    params:
        dataset=reads("neutral", "joints.*.parent", "joints.*.child"),
        edge=SETTINGS.sizes.flesh,
    message:
        "{wildcards.subject}: the flesh between the bones and the skin"


# Of scenes at level L3 (Wang 2019 §5), in place of the tissue above.
rule mesh_crease_tissue:
    input:
        rig=paths.RIG,
        skin=paths.SKIN,
    output:
        paths.CREASE_TISSUE,
    log:
        paths.log_of("mesh_crease_tissue"),
    benchmark:
        paths.cost_of("mesh_crease_tissue")
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=reads("hand"),
        edges=(SETTINGS.sizes.crease, SETTINGS.sizes.skin, SETTINGS.sizes.fat),
    message:
        "{wildcards.subject}: one soft tissue with creases between the bones and the skin"
    script:
        "../scripts/mesh_crease_tissue.py"


rule simulate_inner:
    input:
        rig=paths.RIG,
        layers=lambda w: layer_files(w.subject, layers_in(w.inner)),
        flesh=flesh_under_inner,
    output:
        paths.POSE_LAYERS,
    log:
        paths.log_of("simulate_inner", "pose", "inner"),
    benchmark:
        paths.cost_of("simulate_inner", "pose", "inner")
    wildcard_constraints:
        inner="inner(?:-[a-z_]+)*",
    threads: 1
    resources:
        mem_mb=2000,
        runtime=30,
    params:
        dataset=of_layers(lambda w: layers_in(w.inner)),
        layers=lambda w: layers_in(w.inner),
    message:
        "{wildcards.subject}: layers under the fat in {wildcards.pose}"
    script:
        "../scripts/simulate_inner.py"


rule fit_fat_strains:
    input:
        rig=paths.RIG,
        mesh=paths.FAT,
        inner=paths.POSE_INNER,
        scan=example_scan,
    output:
        paths.FAT_FIT,
    log:
        paths.log_of("fit_fat_strains", "pose"),
    benchmark:
        paths.cost_of("fit_fat_strains", "pose")
    threads: 1
    resources:
        mem_mb=at_size("fat", 3000, 6500),
        runtime=at_size("fat", 30, 120),
    params:
        dataset=reads("nails.names"),
    message:
        "{wildcards.subject}: plastic strains of the fat in {wildcards.pose}"
    script:
        "../scripts/fit_fat_strains.py"


rule collect_fat_strains:
    input:
        rig=paths.RIG,
        mesh=paths.FAT,
        poses=in_poses(paths.FAT_FIT, Role.example),
    output:
        paths.FAT_STRAINS,
    log:
        paths.log_of("collect_fat_strains"),
    benchmark:
        paths.cost_of("collect_fat_strains")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("neutral", "examples"),
        interpolation=SETTINGS.interpolation,
    message:
        "{wildcards.subject}: pose space of the fat"
    script:
        "../scripts/collect_fat_strains.py"


rule simulate_skin:
    input:
        rig=paths.RIG,
        inner=paths.POSE_INNER,
        fat=paths.FAT,
        strains=paths.FAT_STRAINS,
    output:
        paths.POSE_SKIN,
    log:
        paths.log_of("simulate_skin", "pose"),
    benchmark:
        paths.cost_of("simulate_skin", "pose")
    threads: 1
    resources:
        mem_mb=at_size("fat", 2500, 4500),
        runtime=at_size("fat", 10, 60),
    message:
        "{wildcards.subject}: skin of {wildcards.pose}"
    script:
        "../scripts/simulate_skin.py"


rule evaluate_skin:
    input:
        rig=paths.RIG,
        skin=paths.SKIN,
        scans=lambda w: scans(w.subject, scanned(w.subject)),
        skins=lambda w: expand(
            paths.POSE_SKIN,
            pose=scanned(w.subject),
            allow_missing=True,
        ),
        truth=in_truth(paths.TRUTH),
        from_volume=skins_from_volumes,
    output:
        metrics=paths.metrics_of("skin"),
        table=report(
            paths.table_of("skin"),
            caption="../report/skin.rst",
            category="Organs",
            subcategory="{subject}",
        ),
        array=paths.SKIN_ARRAY,
    log:
        paths.log_of("evaluate_skin"),
    benchmark:
        paths.cost_of("evaluate_skin")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "truth", "root"),
        costs=costs_of(
            "make_skin",
            "mesh_fat",
            "fit_fat_strains",
            "collect_fat_strains",
            "simulate_skin",
        ),
    message:
        "{wildcards.subject}: skin against scans"
    script:
        "../scripts/evaluate_skin.py"
