"""The surfaces of all bones of a pose: their marrow's, and in neutral the whole bones'."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor

from handpipe.imaging.cortical import whole_bone
from handpipe.imaging.marrow import marrow_surface
from handpipe.imaging.segmentation import BoneProbability
from handpipe.imaging.volume import Volume
from handpipe.mesh.surface import Surface


def bone_surfaces(
    volume: Volume, bones: Mapping[str, BoneProbability], *, whole: bool, threads: int = 1
) -> dict[str, dict[str, Surface]]:
    """`marrow` and, where asked for, `whole` surface by bone, world mm. The result knows no threads."""
    with ThreadPoolExecutor(threads) as pool:
        marrows = dict(
            zip(bones, pool.map(lambda name: marrow_surface(volume, bones[name]), bones), strict=True)
        )
        surfaces = {name: {"marrow": marrow} for name, marrow in marrows.items()}
        if whole:
            shells = pool.map(_whole_of(volume, bones, marrows), bones)
            for name, shell in zip(bones, shells, strict=True):
                surfaces[name]["whole"] = shell
    return surfaces


def _whole_of(
    volume: Volume, bones: Mapping[str, BoneProbability], marrows: Mapping[str, Surface]
) -> Callable[[str], Surface]:
    def whole(name: str) -> Surface:
        others = [marrows[other] for other in marrows if other != name]
        return whole_bone(volume, bones[name], marrows[name], others)

    return whole
