# Frames of a scene, layer by layer. Frames are independent (Zheng 2022 §3), except in scenes with `follow`.


# Of scenes that describe a motion alone: keyframes, targets of inverse kinematics, tracked points.
rule expand_motion:
    input:
        rig=paths.RIG,
        motion=described_frames,
    output:
        angles=paths.SCENE_ANGLES,
        metrics=paths.metrics_of("motion-{scene}"),
        table=paths.table_of("motion-{scene}"),
    log:
        paths.log_of("expand_motion", "scene"),
    benchmark:
        paths.cost_of("expand_motion", "scene")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=30,
    params:
        scene=reads_scene("recording"),
        dataset=reads("hand"),
    message:
        "{wildcards.subject}: {wildcards.scene}, angles of the frames"
    script:
        "../scripts/expand_motion.py"


rule simulate:
    input:
        rig=paths.RIG,
        frames=frames_file,
        layers=simulated_files,
        before=chunk_before,
    output:
        paths.SCENE_CHUNK,
    log:
        paths.log_of("simulate", "scene", "chunk"),
    benchmark:
        paths.cost_of("simulate", "scene", "chunk")
    # Where frames follow one another, two processes: one for the fat, one a frame ahead for what is under it.
    threads: lambda w: 2 if scene(w.scene).follow and "fat" in scene(w.scene).needed else 1
    resources:
        mem_mb=at_size("fat", 3000, 6000),
        runtime=at_size("fat", 30, 360),
    params:
        partial=lambda w, output: str(paths.partial_chunk(output[0])),
        dataset=of_layers(lambda w: scene(w.scene).needed, "hand"),
        scene=reads_scene(
            "layers", "bones", "chunk", "muscle_barrier", "follow", "viscosity"
        ),
    message:
        "{wildcards.subject}: {wildcards.scene}, frames of chunk {wildcards.chunk}"
    script:
        "../scripts/simulate.py"


# Weights and correctives from the frames of a scene, for scenes that ask for a level below the simulation.
rule learn_levels:
    input:
        rig=paths.RIG,
        chunks=scene_chunks,
    output:
        levels=paths.SCENE_LEVELS,
        portable=paths.SCENE_PORTABLE,
        metrics=paths.metrics_of("levels-{scene}"),
        table=paths.table_of("levels-{scene}"),
    log:
        paths.log_of("learn_levels", "scene"),
    benchmark:
        paths.cost_of("learn_levels", "scene")
    threads: 1
    resources:
        mem_mb=4000,
        runtime=30,
    message:
        "{wildcards.subject}: levels learned from the frames of {wildcards.scene}"
    script:
        "../scripts/learn_levels.py"


rule export_player:
    input:
        rig=paths.RIG,
        levels=paths.SCENE_LEVELS,
        volume=neutral_volume,
    output:
        paths.SCENE_PLAYER,
    log:
        paths.log_of("export_player", "scene"),
    benchmark:
        paths.cost_of("export_player", "scene")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        dataset=reads("name", "hand", "neutral", *image_of("{neutral}")),
    message:
        "{wildcards.subject}: the hand learned from {wildcards.scene} as a page to play with"
    script:
        "../scripts/export_player.py"


rule animate:
    input:
        rig=paths.RIG,
        frames=frames_file,
        levels=lambda w: paths.at(
            paths.SCENE_LEVELS, subject=w.subject, scene=scene(w.scene).learned
        ),
    output:
        paths.SCENE_CHUNK,
    log:
        paths.log_of("animate", "scene", "chunk"),
    benchmark:
        paths.cost_of("animate", "scene", "chunk")
    wildcard_constraints:
        scene=scenes_at("L0", "L1"),
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads("hand"),
        scene=reads_scene("layers", "bones", "chunk", "level"),
    message:
        "{wildcards.subject}: {wildcards.scene}, learned frames of chunk {wildcards.chunk}"
    script:
        "../scripts/animate.py"


# Muscles that bulge and a skin of springs need no simulated frames (Albrecht 2003).
rule animate_springs:
    input:
        rig=paths.RIG,
        frames=frames_file,
        skin=paths.SKIN,
        muscles=muscles_of_scene,
    output:
        paths.SCENE_CHUNK,
    log:
        paths.log_of("animate_springs", "scene", "chunk"),
    benchmark:
        paths.cost_of("animate_springs", "scene", "chunk")
    wildcard_constraints:
        scene=scenes_at("L2"),
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads("hand"),
        scene=reads_scene("layers", "bones", "chunk"),
    message:
        "{wildcards.subject}: {wildcards.scene}, frames of bulging muscles and a skin of springs, chunk {wildcards.chunk}"
    script:
        "../scripts/animate_springs.py"


ruleorder: animate > animate_springs > simulate


# A training set of random poses. Frames that failed are recorded in it, and do not fail it.
rule make_shard:
    input:
        rig=paths.RIG,
        frames=frames_file,
        chunk=paths.SCENE_CHUNK,
    output:
        paths.SCENE_SHARD,
    log:
        paths.log_of("make_shard", "scene", "chunk"),
    benchmark:
        paths.cost_of("make_shard", "scene", "chunk")
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads("hand"),
        scene=reads_scene("bones", "chunk"),
    message:
        "{wildcards.subject}: {wildcards.scene}, shard {wildcards.chunk} of the training set"
    script:
        "../scripts/make_shard.py"


rule index_shards:
    input:
        rig=paths.RIG,
        random=random_frames,
        chunks=scene_chunks,
        shards=scene_shards,
    output:
        index=paths.SCENE_SHARD_INDEX,
        bodies=paths.SCENE_SHARD_BODIES,
    log:
        paths.log_of("index_shards", "scene"),
    benchmark:
        paths.cost_of("index_shards", "scene")
    threads: 1
    resources:
        mem_mb=2000,
        runtime=10,
    params:
        dataset=reads("name", "hand", "licence"),
        scene=reads_scene("level", "learned"),
    message:
        "{wildcards.subject}: {wildcards.scene}, index of the training set"
    script:
        "../scripts/index_shards.py"


# Of scenes that ask for it: the outermost layer is simulated again, from other starts.
rule find_equilibria:
    input:
        rig=paths.RIG,
        frames=paths.SCENE_CHUNK,
        layers=simulated_files,
    output:
        paths.SCENE_EQUILIBRIA,
    log:
        paths.log_of("find_equilibria", "scene", "chunk"),
    benchmark:
        paths.cost_of("find_equilibria", "scene", "chunk")
    threads: 1
    resources:
        mem_mb=at_size("fat", 3000, 6000),
        runtime=at_size("fat", 60, 720),
    params:
        dataset=of_layers(lambda w: scene(w.scene).needed),
        scene=reads_scene("layers"),
    message:
        "{wildcards.subject}: {wildcards.scene}, other equilibria of chunk {wildcards.chunk}"
    script:
        "../scripts/find_equilibria.py"


rule evaluate_frames:
    input:
        rig=paths.RIG,
        frames=frames_file,
        motion=motion_table,
        equilibria=scene_equilibria,
        chunks=scene_chunks,
    output:
        metrics=paths.metrics_of("frames-{scene}"),
        table=report(
            paths.table_of("frames-{scene}"),
            caption="../report/frames.rst",
            category="Simulation",
            subcategory="{subject}",
        ),
    log:
        paths.log_of("evaluate_frames", "scene"),
    benchmark:
        paths.cost_of("evaluate_frames", "scene")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        scene=reads_scene("bones"),
        dataset=reads("hand", "poses.*.role"),
    message:
        "{wildcards.subject}: {wildcards.scene}, figures of the frames"
    script:
        "../scripts/evaluate_frames.py"


rule export_scene:
    input:
        chunks=scene_chunks,
    output:
        glb=paths.SCENE_GLB,
        vtk=directory(paths.SCENE_VTK),
    log:
        paths.log_of("export_scene", "scene"),
    benchmark:
        paths.cost_of("export_scene", "scene")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: {wildcards.scene} as VTU series and glTF"
    script:
        "../scripts/export_scene.py"


rule export_obj:
    input:
        chunks=scene_chunks,
    output:
        directory(paths.SCENE_OBJ),
    log:
        paths.log_of("export_obj", "scene"),
    benchmark:
        paths.cost_of("export_obj", "scene")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    message:
        "{wildcards.subject}: {wildcards.scene} as OBJ files"
    script:
        "../scripts/export_obj.py"


# The last job of `all`: whatever frames failed, everything else is made before it fails. The finished frames of
# a chunk with failed ones are then set aside (`onerror` in the Snakefile), and the next build goes on from them.
rule require_frames:
    input:
        chunks=chunks_of_scenes,
        made=lambda w: each_subject(paths.REPORT)
        + each_subject(paths.metrics_of("build"))
        + obj_sequences()
        + views(),
    output:
        paths.COMPLETE,
    log:
        paths.log_of("require_frames"),
    benchmark:
        paths.cost_of("require_frames")
    threads: 1
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        scenes=SETTINGS.scenes,
    message:
        "{wildcards.subject}: whether every frame was simulated"
    script:
        "../scripts/require_frames.py"


# The last job of `simulation`.
use rule require_frames as require_simulation with:
    input:
        chunks=chunks_of_scenes,
        made=lambda w: each_subject(paths.SCENE_GLB) + obj_sequences() + views(),
    output:
        paths.SIMULATION_COMPLETE,
    log:
        paths.log_of("require_simulation"),
    benchmark:
        paths.cost_of("require_simulation")
