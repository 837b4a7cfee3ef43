# Fat and water of poses with Dixon echoes.


rule separate_fat_water:
    input:
        volume=of_pose("volume"),
        echoes=echoes_of_pose,
    output:
        water=paths.WATER_IMAGE,
        fat=paths.FAT_IMAGE,
        field=paths.FIELD_MAP,
        metrics=paths.FAT_WATER,
    log:
        paths.log_of("separate_fat_water", "pose"),
    benchmark:
        paths.cost_of("separate_fat_water", "pose")
    threads: 1
    resources:
        mem_mb=4000,
        runtime=20,
    params:
        dataset=reads(*image_of(), "poses.{pose}.dixon"),
    message:
        "{wildcards.subject}: separate fat and water of {wildcards.pose}"
    script:
        "../scripts/separate_fat_water.py"
