"""One chunk of a scene's frames, every layer that the scene needs; a failed frame is named and left out.

Finished frames of a killed job, or of one with failed frames, are beside the output and are not made again.
"""

import sys
from pathlib import Path

from common import dataset_of, scene_of, stage

with stage(snakemake):
    from handpipe.hand.frames import finished_frames, write_frames
    from handpipe.hand.layer_loading import load_layers
    from handpipe.hand.resume import key_of
    from handpipe.hand.simulation import simulate
    from handpipe.layers import Frame
    from handpipe.skeleton.drivers.scene_frames import read_frames
    from handpipe.skeleton.rig import Rig

    dataset, scene = dataset_of(snakemake), scene_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    driven = read_frames(snakemake.input.frames, rig, hand=dataset.hand, bones=scene.bones)
    frames = list(driven.items())
    first = int(snakemake.wildcards.chunk) * scene.chunk
    wanted = [
        Frame(name, angles, rig.bone_transforms(angles))
        for name, angles in frames[first : first + scene.chunk]
    ]
    layers = load_layers(scene.needed, dataset, f"results/{snakemake.wildcards.subject}", rig.surfaces)
    output = Path(snakemake.output[0])
    partial = Path(snakemake.params.partial)
    parameters = {name: snakemake.params[name] for name in ("dataset", "code")}
    key = key_of([snakemake.input.rig, *snakemake.input.layers], {**parameters, "layers": scene.needed})

    def keep(found):
        """Finished frames beside the output, but for the last frame: the output follows."""
        if len(found.frames) + len(found.failures) < len(wanted):
            write_frames(partial, found.frames, key=key)

    found = simulate(wanted, layers, finished_frames(partial, key, wanted), keep)
    write_frames(output, found.frames, [*snakemake.input], failures=found.failures, key=key)
    partial.unlink(missing_ok=True)
    for failure in found.failures:
        print(f"handpipe: simulate: {failure}", file=sys.stderr)
