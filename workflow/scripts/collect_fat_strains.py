"""The fat's strains and nail corrections over the poses, neutral (none) among them."""

from common import dataset_of, stage

with stage(snakemake):
    import numpy as np

    from handpipe import artifacts
    from handpipe.fat.layer import FatStrains
    from handpipe.fat.tissue import Tissue
    from handpipe.mesh.rigid import RigidTransform
    from handpipe.skeleton.local_pose_spaces import LocalPoseSpaces
    from handpipe.skeleton.rig import Rig

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    fits = [artifacts.read(path, "fat_fit") for path in snakemake.input.poses]
    transforms = {dataset.neutral: dict.fromkeys(rig.bones, RigidTransform.identity())}
    transforms |= {pose: rig.scanned_bones(pose) for pose in dataset.examples}
    spaces = LocalPoseSpaces.build(rig.bones, rig.parents, transforms, snakemake.params.interpolation)
    logs = np.stack([np.zeros_like(fits[0]["log_strains"]), *(f["log_strains"] for f in fits)])
    nails = {
        name: np.stack([np.zeros(6), *(f["nails"][name] for f in fits)]) for name in fits[0].get("nails", {})
    }
    tissue = Tissue.load(snakemake.input.mesh)
    found = [tissue.shifts(transforms[p], f["vertices"]) for p, f in zip(dataset.examples, fits, strict=True)]
    shifts = np.stack([np.zeros_like(found[0]), *found])
    FatStrains(spaces, logs, nails, shifts).save(snakemake.output[0], [*snakemake.input])
