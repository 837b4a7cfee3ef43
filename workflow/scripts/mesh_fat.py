"""The fat: tetrahedra between the neutral inner layers and the skin, and what holds them."""

from common import stage

with stage(snakemake):
    from handpipe.fat.mesh import inner_surface
    from handpipe.fat.skin import Skin
    from handpipe.hand.frames import read_frames
    from handpipe.layer_registry import under_fat
    from handpipe.mesh.surface import Surface
    from handpipe.skeleton.rig import Rig
    from tissue import make_tissue

    rig = Rig.load(snakemake.input.rig)
    [(_, below)] = read_frames(snakemake.input.inner)
    bodies = [
        Surface(s.vertices, s.cells)
        for n in under_fat()
        for s in below.get(n, {}).values()
        if s.cells.shape[1] == 3
    ]
    inner = inner_surface(bodies, spacing=0.8, gap=1.0)
    tissue = make_tissue(
        rig.surfaces, below, under_fat(), inner, 1.0, Skin.load(snakemake.input.skin), snakemake.params.edge
    )
    tissue.save(snakemake.output[0], [snakemake.input.inner, snakemake.input.skin])
