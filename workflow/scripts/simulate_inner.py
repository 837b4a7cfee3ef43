"""All layers under the fat in one scanned pose."""

from common import stage

with stage(snakemake):
    from handpipe.config import load_dataset
    from handpipe.hand.frames import write_frames
    from handpipe.hand.simulation import simulate
    from handpipe.skeleton.rig import Rig
    from layers import layers_of, scanned_frame

    dataset = load_dataset(snakemake.input.dataset)
    rig = Rig.load(snakemake.input.rig)
    layers = layers_of(snakemake.params.layers, rig, dataset, f"results/{snakemake.wildcards.subject}")
    frames = simulate([scanned_frame(rig, snakemake.wildcards.pose)], layers)
    write_frames(snakemake.output[0], frames, [*snakemake.input])
