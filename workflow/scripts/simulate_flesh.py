"""The flesh in one scanned pose, which carries the hooks of tendons and the muscles."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.hand.frames import write_frames
    from handpipe.hand.layer_loading import load_layers
    from handpipe.skeleton.rig import Rig
    from layers import scanned_frame

    rig = Rig.load(snakemake.input.rig)
    frame = scanned_frame(rig, snakemake.wildcards.pose)
    dataset = dataset_of(snakemake)
    bones, flesh = load_layers(
        ["bones", "flesh"], dataset, f"results/{snakemake.wildcards.subject}", rig.surfaces
    )
    below = {bones.name: bones.solve(frame, {})}
    write_frames(snakemake.output[0], [(frame, {flesh.name: flesh.solve(frame, below)})], [*snakemake.input])
