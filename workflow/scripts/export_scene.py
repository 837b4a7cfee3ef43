"""A scene's frames for other programs: VTU series with .pvd, and glTF with the motion."""

from pathlib import Path

from common import stage

with stage(snakemake):
    from handpipe.hand.export import write_glb, write_vtu_series
    from handpipe.hand.frames import read_frames

    frames = [frame for chunk in snakemake.input.chunks for frame in read_frames(chunk)]
    Path(snakemake.output.vtk).mkdir(parents=True, exist_ok=True)
    write_vtu_series(snakemake.output.vtk, frames)
    write_glb(snakemake.output.glb, frames)
