# Ligaments: as muscles, without contact.


rule fit_ligament:
    input:
        rig=paths.RIG,
        templates=paths.PLACED_TEMPLATES,
    output:
        paths.LIGAMENT,
    log:
        paths.log_of("fit_ligament", "ligament"),
    benchmark:
        paths.cost_of("fit_ligament", "ligament")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("neutral"),
    message:
        "{wildcards.subject}: place the {wildcards.ligament} ligament"
    script:
        "../scripts/fit_ligament.py"
