"""One soft tissue between the bones and the skin (Wang 2019 §5)."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.fascia.wrapping import bone_wrap
    from handpipe.fat.skin import Skin
    from handpipe.skeleton.layer import BoneLayer
    from handpipe.skeleton.rig import Rig
    from layers import scanned_frame
    from tissue import make_tissue

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    below = {"bones": BoneLayer(rig.surfaces).solve(scanned_frame(rig, dataset.neutral), {})}
    inner = bone_wrap(rig.surfaces, [(j.parent, j.child) for j in dataset.joints.values()], edge=1.5)
    # Wang 2019 §5.5: one tissue between fat and muscle; its stiffness does not change a free pose's shape.
    skin = Skin.load(snakemake.input.skin)
    tissue = make_tissue(rig.surfaces, below, ("bones",), inner, 6.0, skin, snakemake.params.edge)
    tissue.save(snakemake.output[0], [*snakemake.input])
