"""A ligament: its placed template as an elastic body held by its bones, without contact (Zheng 2022 §4.1)."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.ligaments.fitting import fit_ligament
    from handpipe.skeleton.rig import Rig
    from muscle_files import read_guesses

    dataset = dataset_of(snakemake)
    name = snakemake.wildcards.ligament
    rig = Rig.load(snakemake.input.rig)
    [guess] = read_guesses(snakemake.input.templates, [name]).values()
    ligament = fit_ligament(name, guess, rig.parents, dataset.neutral)
    ligament.save(snakemake.output[0], [*snakemake.input])
