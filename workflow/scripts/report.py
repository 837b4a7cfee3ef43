"""One HTML file with pictures, tables, figures and costs of a subject."""

import json
from pathlib import Path

from common import dataset_of, stage

with stage(snakemake):
    from handpipe import metrics
    from handpipe.evaluation.build import read_jobs
    from handpipe.evaluation.frames import frame_warnings, pose_warnings
    from handpipe.evaluation.report import PoseView, ReportInput, write_report
    from handpipe.hand.frames import read_frames
    from handpipe.imaging.volume import pose_volume
    from handpipe.mesh.scan import read_scan
    from handpipe.skeleton.rig import Rig
    from truth import surfaces_in, true_pose

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    base = Path("results") / snakemake.wildcards.subject
    BENCHMARKS = Path("results/benchmarks/fem.json")  # shown where someone has made it

    def truth_of(pose):
        """True surfaces by tissue, where the subject has a truth."""
        if dataset.truth is None:
            return {}
        data = true_pose(dataset, pose)
        found = {kind: data.get(kind, {}) for kind in ("bones", "muscles", "ligaments")}
        found["skin"] = {"skin": data["skin"]}
        return {kind: [*surfaces_in(group).values()] for kind, group in found.items()}

    def view(pose):
        files = {Path(p).stem.split("-")[0]: p for p in snakemake.input.poses if Path(p).parent.name == pose}
        [(frame, layers)] = read_frames(files["inner"])
        if "skin" in files:
            [(_, skins)] = read_frames(files["skin"])
            layers |= {"fat": skins["m0"]}
        data = dataset.poses[pose]
        return PoseView.from_scanner(
            frame,
            layers,
            data.role.value,
            rig.poses[pose].root,
            sample=pose_volume(dataset, pose).sample,
            scan=read_scan(dataset.path(data.scan)) if data.scan else None,
            truth=truth_of(pose),
        )

    def bend(pose):
        return sum(abs(angle) for angle in rig.poses[pose].angles.values())

    asked = {Path(p).stem: metrics.read(p) for p in snakemake.input.metrics}

    def table(name):
        """A stage's table, where this report has the stage; an older build may have left others."""
        path = base / f"tables/{name}.json"
        return json.loads(path.read_text(encoding="utf-8")) if name in asked else []

    simulated = sorted({Path(p).parent.name for p in snakemake.input.poses})
    bent = sorted((p for p in simulated if p in dataset.examples), key=bend)[-2:]
    shown = [p for p in dataset.poses if p in simulated and (p in bent or p not in dataset.examples)]
    scenes = {
        name: [frame for path in paths for frame in read_frames(path)]
        for name, paths in snakemake.params.scenes.items()
    }
    warnings = pose_warnings(table("poses"))
    warnings += [said for name in scenes for said in frame_warnings(name, table(f"frames-{name}"))]
    write_report(
        snakemake.output[0],
        ReportInput(
            dataset,
            poses=[view(pose) for pose in shown],
            skin_rows=table("skin"),
            muscle_rows=table("muscles"),
            rig_rows=table("rig"),
            metrics=asked,
            scenes=scenes,
            warnings=warnings,
            jobs=read_jobs(base / "benchmarks"),
            benchmarks=metrics.read(BENCHMARKS) if BENCHMARKS.exists() else {},
            settings=snakemake.params.settings,
            limits=["The limits of this version stand in docs/limitations.md."],
            finger=list(rig.bones),
        ),
    )
