"""The fat: tetrahedra between the neutral inner layers and the skin, and what holds them."""

from common import stage

with stage(snakemake) as log:
    from handpipe.config import load_dataset
    from handpipe.fat.mesh import inner_surface
    from handpipe.fat.skin import Skin
    from handpipe.hand.simulation import simulate_frame
    from handpipe.layers import Frame
    from handpipe.mesh.rigid import RigidTransform
    from handpipe.mesh.surface import Surface
    from handpipe.skeleton.rig import Rig
    from layers import INNER, layers_of
    from tissue import make_tissue

    dataset = load_dataset(snakemake.input.dataset)
    rig = Rig.load(snakemake.input.rig)
    base = f"results/{snakemake.wildcards.subject}"
    layers = layers_of(snakemake.params.layers, rig, dataset, base)
    neutral = Frame(
        dataset.neutral,
        dict.fromkeys(rig.angle_names, 0.0),
        dict.fromkeys(rig.bones, RigidTransform.identity()),
    )
    below = simulate_frame(neutral, layers)
    bodies = [
        Surface(s.vertices, s.cells)
        for n in INNER
        for s in below.get(n, {}).values()
        if s.cells.shape[1] == 3
    ]
    inner = inner_surface(bodies, spacing=0.8, gap=1.0)
    tissue = make_tissue(
        rig.surfaces, below, INNER, inner, 1.0, Skin.load(snakemake.input.skin), snakemake.params.edge, log
    )
    tissue.save(snakemake.output[0], [*snakemake.input.layers, snakemake.input.skin])
