"""The skin of one scanned pose by three models (Zheng 2022 Table 4): full, without fat strains, one soft
tissue."""

from common import stage

with stage(snakemake):
    from handpipe.hand.frames import read_frames, write_frames
    from layers import fat_layer, soft_tissue_layer

    base = f"results/{snakemake.wildcards.subject}"
    [(frame, below)] = read_frames(snakemake.input.inner)
    models = {"m0": fat_layer(base), "m1": fat_layer(base, strains=False), "m2": soft_tissue_layer(base)}
    skins = {name: layer.solve(frame, below) for name, layer in models.items()}
    write_frames(snakemake.output[0], [(frame, skins)], [*snakemake.input])
