"""All layers under the fat in one scanned pose, as a variant of the full model has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.hand import load_layers, read_frames, simulate_frame, write_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.baselines.true_organs import true_muscles, true_tendons, with_true_bones
from handpipe.stages.baselines.variants import VARIANTS
from handpipe.stages.files import Files
from handpipe.tissues.tendons import TendonLayer


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    layers: Sequence[Path]
    flesh: Path | None
    truth: Sequence[Path]


def simulate_ablated_inner(inputs: Inputs, output: Path, dataset: Dataset, variant: str) -> None:
    """All layers under the fat in one scanned pose, as a variant of the full model has them.

    Layers that the variant neither leaves out nor changes are those of the full model, to the last bit.
    """
    chosen, rig = VARIANTS[variant], Rig.load(inputs.rig)
    [(frame, full)] = read_frames(inputs.inner)
    layers = load_layers(chosen.loaded, dataset, inputs.layers, rig.surfaces)
    if "bones" in chosen.true:
        frame = with_true_bones(frame, rig, inputs.truth)
    known = {n: s for n, s in full.items() if n not in (*chosen.without, *chosen.loaded)}
    for layer in layers:
        if layer.name in chosen.true and isinstance(layer, TendonLayer):
            known[layer.name] = true_tendons(layer, frame, rig, inputs.truth)
    if "muscles" in chosen.true:
        shapes = full["muscles"]
        known["muscles"] = true_muscles(shapes, frame, rig, inputs.truth, dataset.neutral)
    if inputs.flesh:
        known |= read_frames(inputs.flesh)[0][1]
    simulated = simulate_frame(frame, [chosen.changed(layer) for layer in layers], known)
    write_frames(output, [(frame, simulated)], inputs.all())
