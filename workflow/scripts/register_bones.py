"""Rigid registration of every bone's neutral marrow into one pose, from the root outwards."""

from common import stage

with stage(snakemake) as log:
    from handpipe import artifacts
    from handpipe.config import load_dataset
    from handpipe.skeleton.bones import read_surfaces
    from handpipe.skeleton.registration import register
    from handpipe.skeleton.rig import outwards

    dataset = load_dataset(snakemake.input.dataset)
    neutral, target = (read_surfaces(p, "marrow") for p in (snakemake.input.neutral, snakemake.input.target))
    parents = {j.child: j.parent for j in dataset.joints.values()}
    found = {}
    for bone in [dataset.root_bone, *(dataset.joints[j].child for j in outwards(dataset))]:
        start = found[parents[bone]].transform if bone in parents else None
        found[bone] = register(neutral[bone], target[bone], start=start)
        log.info("%s: rms %.3f mm", bone, found[bone].rms)
    data = {
        bone: {
            "rotation": r.transform.rotation,
            "translation": r.transform.translation,
            "rms": r.rms,
            "covariance": r.covariance,
        }
        for bone, r in found.items()
    }
    units = {f"{bone}/{field}": "mm" for bone in found for field in ("translation", "rms")}
    artifacts.write(snakemake.output[0], data, kind="registration", units=units, inputs=[*snakemake.input])
