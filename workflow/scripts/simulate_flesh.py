"""The flesh in one scanned pose, which carries the hooks of tendons and the muscles."""

from common import dataset_of, stage

with stage(snakemake):
    from handpipe.hand.frames import write_frames
    from handpipe.skeleton.rig import Rig
    from layers import layers_of, scanned_frame

    rig = Rig.load(snakemake.input.rig)
    frame = scanned_frame(rig, snakemake.wildcards.pose)
    dataset = dataset_of(snakemake)
    bones, flesh = layers_of(["bones", "flesh"], rig, dataset, f"results/{snakemake.wildcards.subject}")
    below = {bones.name: bones.solve(frame, {})}
    write_frames(snakemake.output[0], [(frame, {flesh.name: flesh.solve(frame, below)})], [*snakemake.input])
