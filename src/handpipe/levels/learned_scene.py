"""Whether a scene at a learned level and the scene that it is learned from suit each other."""

from __future__ import annotations

from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Scene


def require_learned(source: str | Path, scene: Scene, learned: Scene) -> None:
    """Refuse a scene at a learned level whose frames are to be learned from an unsuitable one.

    Parameters
    ----------
    source : path
        File of the scene, for the error's text.
    scene : Scene
        Scene with `level` L0 or L1.
    learned : Scene
        Scene that its field `learned` names.

    Raises
    ------
    InputError
        If the other scene is not simulated itself, lacks a layer, or models other bones.
    """
    remedy = "Name a scene of random poses that simulates all layers of this one"
    if learned.level != "full":
        raise InputError(source, "learned", f"{scene.learned} is itself of level {learned.level}", remedy)
    missing = [layer for layer in scene.layers if layer not in learned.needed]
    if missing:
        raise InputError(source, "learned", f"{scene.learned} has no {', '.join(missing)}", remedy)
    if scene.only != learned.only:
        raise InputError(source, "only", f"{scene.learned} models other bones", "Give both the same `only`")
