"""A scene's frames as OBJ files, for programs that read nothing else."""

from common import stage

with stage(snakemake):
    from handpipe.hand.export import write_obj_sequence
    from handpipe.hand.frames import read_frames

    frames = [frame for chunk in snakemake.input.chunks for frame in read_frames(chunk)]
    write_obj_sequence(snakemake.output[0], frames)
