# Frames of a scene, layer by layer; frames do not depend on one another (Zheng 2022 §3).


rule simulate:
    input:
        rig="results/{subject}/rig.h5",
        frames=frames_file,
        layers=lambda w: layer_files(w.subject, scene(w.scene).needed),
    output:
        "results/{subject}/simulation/{scene}/frames-{chunk}.h5",
    log:
        "results/{subject}/logs/simulate/{scene}/{chunk}.log",
    benchmark:
        "results/{subject}/benchmarks/simulate/{scene}/{chunk}.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=30,
    params:
        partial=lambda w, output: partial_chunk(output[0]),
        dataset=of_layers(lambda w: scene(w.scene).needed, "hand"),
        scene=reads_scene("layers", "bones", "chunk"),
    message:
        "{wildcards.subject}: {wildcards.scene}, frames of chunk {wildcards.chunk}"
    script:
        "../scripts/simulate.py"


rule evaluate_frames:
    input:
        rig="results/{subject}/rig.h5",
        frames=frames_file,
        chunks=scene_chunks,
    output:
        metrics="results/{subject}/metrics/frames-{scene}.json",
        table=report(
            "results/{subject}/tables/frames-{scene}.json",
            caption="../report/frames.rst",
            category="Simulation",
            subcategory="{subject}",
        ),
    log:
        "results/{subject}/logs/evaluate_frames/{scene}.log",
    benchmark:
        "results/{subject}/benchmarks/evaluate_frames/{scene}.tsv"
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
        glb="results/{subject}/simulation/{scene}/{scene}.glb",
        vtk=directory("results/{subject}/simulation/{scene}/vtk"),
    log:
        "results/{subject}/logs/export_scene/{scene}.log",
    benchmark:
        "results/{subject}/benchmarks/export_scene/{scene}.tsv"
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
        directory("results/{subject}/simulation/{scene}/obj"),
    log:
        "results/{subject}/logs/export_obj/{scene}.log",
    benchmark:
        "results/{subject}/benchmarks/export_obj/{scene}.tsv"
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
        made=lambda w: each_subject("report.html")
        + each_subject("metrics/build.json")
        + obj_sequences(),
    output:
        "results/{subject}/complete.json",
    log:
        "results/{subject}/logs/require_frames/all.log",
    benchmark:
        "results/{subject}/benchmarks/require_frames/all.tsv"
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
        made=lambda w: each_subject("simulation/{scene}/{scene}.glb") + obj_sequences(),
    output:
        "results/{subject}/simulation/complete.json",
    log:
        "results/{subject}/logs/require_simulation/all.log",
    benchmark:
        "results/{subject}/benchmarks/require_simulation/all.tsv"
