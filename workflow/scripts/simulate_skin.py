"""The skin of one scanned pose by three models (Zheng 2022 Table 4): full, without fat strains, one soft
tissue."""

from common import stage

with stage(snakemake):
    from handpipe.fat.layer import load_fat, load_skin
    from handpipe.hand.frames import read_frames, write_frames

    [(frame, below)] = read_frames(snakemake.input.inner)
    fat = load_fat([snakemake.input.fat, snakemake.input.strains], {})
    models = {"m0": fat, "m1": fat.without_strains(), "m2": load_skin([snakemake.input.soft_tissue], {})}
    skins = {name: layer.solve(frame, below) for name, layer in models.items()}
    write_frames(snakemake.output[0], [(frame, skins)], [*snakemake.input])
