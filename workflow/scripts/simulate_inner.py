"""All layers under the fat in one scanned pose."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.hand.frames import read_frames, write_frames
    from handpipe.hand.layer_loading import load_layers
    from handpipe.hand.simulation import simulate_frame
    from handpipe.skeleton.rig import Rig
    from layers import scanned_frame

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    layers = load_layers(
        snakemake.params.layers, dataset, f"results/{snakemake.wildcards.subject}", rig.surfaces
    )
    frame = scanned_frame(rig, snakemake.wildcards.pose)
    known = read_frames(snakemake.input.flesh)[0][1] if snakemake.input.flesh else None
    write_frames(snakemake.output[0], [(frame, simulate_frame(frame, layers, known))], [*snakemake.input])
