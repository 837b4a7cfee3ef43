"""Nail corrections and plastic strains of the fat in one example pose (000 sections 7.2 and 7.3)."""

from common import dataset_of, stage

with stage(snakemake) as log:
    from handpipe import artifacts
    from handpipe.fat.nails import as_vector, fit_correction
    from handpipe.fat.strains import FitSettings, fit_strains
    from handpipe.fat.tissue import Tissue
    from handpipe.hand.frames import figure_units, read_frames
    from handpipe.mesh.scan import read_scan
    from handpipe.skeleton.rig import Rig

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    tissue = Tissue.load(snakemake.input.mesh)
    [(frame, below)] = read_frames(snakemake.input.inner)
    scan = read_scan(snakemake.input.scan)
    scan = scan.moved(rig.poses[frame.name].root.inverse()(scan.vertices))

    nails, rigid = {}, {}
    for name, part in tissue.rigid.items():
        rigid[name] = frame.bones[part.bone]
        if name in dataset.nails:
            points = tissue.skin.vertices[part.vertices]
            correction = fit_correction(points, frame.bones[part.bone], scan)
            nails[name] = as_vector(correction, points.mean(axis=0))
            rigid[name] = frame.bones[part.bone] @ correction
    name = f"strains of the fat in {frame.name}"
    fit = fit_strains(tissue, below, rigid, scan, tissue.pose(frame.bones), FitSettings(), name)
    record = {key: [row[key] for row in fit.record] for key in fit.record[0]}
    data = {"log_strains": fit.log_strains, "vertices": fit.vertices, "nails": nails, "record": record}
    data["figures"] = fit.figures
    inputs = [snakemake.input.mesh, snakemake.input.inner, snakemake.input.scan]
    artifacts.write(
        snakemake.output[0],
        data,
        kind="fat_fit",
        units={"vertices": "mm", "record/mean_gap": "mm"} | figure_units(fit.figures),
        inputs=inputs,
    )
