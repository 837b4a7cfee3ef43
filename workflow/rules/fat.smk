# Fat and skin: mesh, constraints, nails, plastic strains (Zheng 2022 §7), and the single soft tissue of Wang 2019.


rule make_skin:
    input:
        scan=neutral_scan,
        nails=lambda w: nail_files(w.subject),
    output:
        "results/{subject}/skin.h5",
    log:
        "results/{subject}/logs/make_skin/all.log",
    benchmark:
        "results/{subject}/benchmarks/make_skin/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("root", "nails", "root_bone"),
        edge=SETTINGS.edges.skin,
    message:
        "{wildcards.subject}: neutral skin from its scan"
    script:
        "../scripts/make_skin.py"


rule mesh_fat:
    input:
        rig="results/{subject}/rig.h5",
        inner=lambda w: f"results/{w.subject}/poses/{neutral(w.subject)}/inner.h5",
        skin="results/{subject}/skin.h5",
    output:
        "results/{subject}/fat/mesh.h5",
    log:
        "results/{subject}/logs/mesh_fat/all.log",
    benchmark:
        "results/{subject}/benchmarks/mesh_fat/all.tsv"
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        edge=SETTINGS.edges.fat,
    message:
        "{wildcards.subject}: tetrahedra between the inner surface and the skin"
    script:
        "../scripts/mesh_fat.py"


rule mesh_soft_tissue:
    input:
        rig="results/{subject}/rig.h5",
        skin="results/{subject}/skin.h5",
    output:
        "results/{subject}/soft_tissue/mesh.h5",
    log:
        "results/{subject}/logs/mesh_soft_tissue/all.log",
    benchmark:
        "results/{subject}/benchmarks/mesh_soft_tissue/all.tsv"
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    params:
        dataset=reads("neutral", "joints.*.parent", "joints.*.child"),
        edge=SETTINGS.edges.fat,
    message:
        "{wildcards.subject}: one soft tissue between the bones and the skin"
    script:
        "../scripts/mesh_soft_tissue.py"


rule simulate_inner:
    input:
        rig="results/{subject}/rig.h5",
        layers=lambda w: layer_files(w.subject, layers_in(w.inner)),
        flesh=flesh_under_inner,
    output:
        "results/{subject}/poses/{pose}/{inner}.h5",
    log:
        "results/{subject}/logs/simulate_inner/{pose}/{inner}.log",
    benchmark:
        "results/{subject}/benchmarks/simulate_inner/{pose}/{inner}.tsv"
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
        rig="results/{subject}/rig.h5",
        mesh="results/{subject}/fat/mesh.h5",
        inner="results/{subject}/poses/{pose}/inner.h5",
        scan=example_scan,
    output:
        "results/{subject}/fat/poses/{pose}.h5",
    log:
        "results/{subject}/logs/fit_fat_strains/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/fit_fat_strains/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        dataset=reads("nails.names"),
    message:
        "{wildcards.subject}: plastic strains of the fat in {wildcards.pose}"
    script:
        "../scripts/fit_fat_strains.py"


rule collect_fat_strains:
    input:
        rig="results/{subject}/rig.h5",
        mesh="results/{subject}/fat/mesh.h5",
        poses=in_poses("results/{subject}/fat/poses/{pose}.h5", Role.example),
    output:
        "results/{subject}/fat/strains.h5",
    log:
        "results/{subject}/logs/collect_fat_strains/all.log",
    benchmark:
        "results/{subject}/benchmarks/collect_fat_strains/all.tsv"
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
        rig="results/{subject}/rig.h5",
        inner="results/{subject}/poses/{pose}/inner.h5",
        fat="results/{subject}/fat/mesh.h5",
        strains="results/{subject}/fat/strains.h5",
        soft_tissue="results/{subject}/soft_tissue/mesh.h5",
    output:
        "results/{subject}/poses/{pose}/skin.h5",
    log:
        "results/{subject}/logs/simulate_skin/{pose}.log",
    benchmark:
        "results/{subject}/benchmarks/simulate_skin/{pose}.tsv"
    threads: 1
    resources:
        mem_mb=2500,
        runtime=10,
    message:
        "{wildcards.subject}: skin of {wildcards.pose} by the full, the strain-free and the single-tissue model"
    script:
        "../scripts/simulate_skin.py"


rule evaluate_skin:
    input:
        rig="results/{subject}/rig.h5",
        skin="results/{subject}/skin.h5",
        scans=lambda w: [
            p
            for p in [
                dataset(w.subject).path(dataset(w.subject).poses[n].scan)
                for n in scanned(w.subject)
            ]
        ],
        skins=lambda w: expand(
            "results/{subject}/poses/{pose}/skin.h5",
            pose=scanned(w.subject),
            allow_missing=True,
        ),
    output:
        metrics="results/{subject}/metrics/skin.json",
        table=report(
            "results/{subject}/tables/skin.json",
            caption="../report/skin.rst",
            category="Organs",
            subcategory="{subject}",
        ),
        array="results/{subject}/tables/skin.nc",
    log:
        "results/{subject}/logs/evaluate_skin/all.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_skin/all.tsv"
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("poses.*.role", "truth", "root"),
    message:
        "{wildcards.subject}: skin against scans"
    script:
        "../scripts/evaluate_skin.py"
