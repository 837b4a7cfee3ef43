"""Judges the bones of the finger under each effect, against the phantom's truth alone."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.bones.chain import EVERY, segment
from benchmarks.bones.errors import overlap
from benchmarks.bones.hard_cases import BARS
from benchmarks.bones.outcome import SETTINGS
from benchmarks.images.subject import Setting, finger_scan
from handpipe.core import Metrics
from handpipe.core.configuration import Strength
from handpipe.evaluation import surface_distance
from handpipe.mesh.surfaces import Surface
from handpipe.synthetic.acquisition.physics.effects import EFFECTS

log = logging.getLogger(__name__)

STRENGTHS: tuple[Strength, ...] = ("usual", "severe")
VOXELS = (0.5, 0.65, 0.8, 1.0)  # mm, with all effects at usual strength
COARSE = 0.8  # mm, the voxels of the generated finger
NOISES: tuple[Strength, ...] = ("none", "usual", "severe")


@dataclass(frozen=True)
class Row:
    """What came of a setting.

    effect: name of the effect, or what is imaged; bones: how many there are; dice: mean and least of found
    bones; surface: mean distance of their surfaces from truth in mm, of the worst bone; wrong: bones not
    found or below the bar, in words; silent: wrong bones that nothing was said of; alarms: right ones that
    something was said of; said: the library's words; seconds: processor time of the segmentation.
    """

    effect: str
    strength: str
    bones: int
    dice: tuple[float, float] | None
    surface: float | None
    wrong: list[str]
    silent: list[str]
    alarms: int
    said: list[str]
    seconds: float


def settings(spacing: float = 0.5) -> Iterator[tuple[str, str, Setting]]:
    """Every row of the table in a voxel size in mm: what is imaged, how strong its effects are, setting."""
    for effect, strength, setting in _settings():
        yield effect, strength, replace(setting, spacing=spacing)


def _settings() -> Iterator[tuple[str, str, Setting]]:
    yield "painted image, as before", "", Setting(sequence=None)
    yield "spin echo without effects", "", Setting()
    for effect in EFFECTS:
        for strength in STRENGTHS:
            yield effect, strength, Setting(strengths=((effect, strength),))
    yield "all effects", "usual", Setting(others="usual")
    yield "all effects, 1.5 T", "usual", Setting(others="usual", field=1.5)
    yield "gradient echo in phase", "none", Setting("gradient_echo_in_phase")
    yield "gradient echo in phase, all effects", "usual", Setting("gradient_echo_in_phase", others="usual")
    yield "gradient echo opposed", "none", Setting("gradient_echo_opposed")
    yield "gradient echo opposed, all effects", "usual", Setting("gradient_echo_opposed", others="usual")


def sweep() -> Iterator[tuple[str, str, Setting]]:
    """Speed against error: voxel sizes and noise with all other effects at usual strength."""
    for spacing in VOXELS:
        yield "all effects", f"voxels of {spacing:g} mm", Setting(others="usual", spacing=spacing)
    for noise in NOISES:
        setting = Setting(others="usual", strengths=(("noise", noise),))
        yield "all effects", f"noise {noise}", setting


def measure(effect: str, strength: str, setting: Setting) -> Row:
    """Segment the finger under a setting and compare each bone with truth, where its marrow is imaged."""
    scan = finger_scan(setting)
    found = segment(scan, SETTINGS, None)
    said, moved = found.notes.said, np.array([setting.displacement, 0.0, 0.0])
    dices, surfaces, wrong, silent, alarms = [], [], [], [], 0
    for bone in scan.labels:
        heard = bool(said.get(bone)) or bone not in found.whole
        if bone not in found.whole:
            wrong.append(f"{bone} (not found)")
            if not said.get(bone) and not said.get(EVERY):
                silent.append(bone)
            continue
        vertices, triangles = scan.posed.bones[bone]
        truth = (vertices + moved, triangles)
        dice = overlap(found.whole[bone], truth, scan)
        away = _away(found.whole[bone], Surface(*truth))
        dices.append(dice)
        surfaces.append(away)
        if dice < BARS.dice_min:
            wrong.append(f"{bone} (Dice {dice:.2f}, {away:.2f} mm)")
            silent += [] if heard else [bone]
        else:
            alarms += heard
    row = Row(
        effect,
        strength,
        len(scan.labels),
        (float(np.mean(dices)), min(dices)) if dices else None,
        max(surfaces) if surfaces else None,
        wrong,
        silent,
        alarms,
        [text for texts in said.values() for text in texts],
        found.notes.seconds,
    )
    log.info(
        "%s, %s: %s; wrong %s; silent %s; alarms %d; %.1f s",
        effect,
        strength,
        row.dice,
        wrong,
        silent,
        alarms,
        row.seconds,
    )
    return row


def _away(found: Surface, truth: Surface) -> float:
    """Mean distance in mm between two surfaces, from the vertices of each."""
    both = (surface_distance(found.vertices, truth), surface_distance(truth.vertices, found))
    return float(np.mean(np.concatenate(both)))


def figures(rows: Sequence[Row], coarse: Sequence[Row] = ()) -> Metrics:
    """How many effects there are, and in how many rows a wrong bone goes unnoticed."""
    effects = {row.effect for row in rows} & set(EFFECTS)
    usual = next((row for row in rows if (row.effect, row.strength) == ("all effects", "usual")), None)
    found: Metrics = {
        "image_effects": (len(effects), "1"),
        "image_effects_silent": (sum(bool(row.silent) for row in rows), "1"),
        "image_effects_silent_coarse": (sum(bool(row.silent) for row in coarse), "1"),
        "image_effects_rows": (len(rows), "1"),
        "image_effects_wrong_bones": (sum(len(row.wrong) for row in rows), "1"),
        "image_effects_false_alarms": (sum(row.alarms for row in rows), "1"),
    }
    if usual and usual.dice:
        found["image_effects_usual_dice_min"] = (usual.dice[1], "1")
    return found
