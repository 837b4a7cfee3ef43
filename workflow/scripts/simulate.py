"""One chunk of a scene's frames, every layer that the scene needs."""

from common import dataset_of, scene_of, stage

with stage(snakemake):
    from handpipe.hand.frames import write_frames
    from handpipe.hand.simulation import simulate
    from handpipe.layers import Frame
    from handpipe.skeleton.drivers.scene_frames import read_frames
    from handpipe.skeleton.rig import Rig
    from layers import layers_of

    dataset, scene = dataset_of(snakemake), scene_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    driven = read_frames(snakemake.input.frames, rig, hand=dataset.hand, bones=scene.bones)
    frames = list(driven.items())
    first = int(snakemake.wildcards.chunk) * scene.chunk
    wanted = [
        Frame(name, angles, rig.bone_transforms(angles))
        for name, angles in frames[first : first + scene.chunk]
    ]
    layers = layers_of(scene.needed, rig, dataset, f"results/{snakemake.wildcards.subject}")
    write_frames(snakemake.output[0], simulate(wanted, layers), [*snakemake.input])
