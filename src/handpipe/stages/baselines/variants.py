"""Variants of the full model: one part left out or changed, or one organ replaced by its truth.

A variant is a record of what differs from the full model. All else is the full model's, its files included.
The stages of this package read the record, and simulate with the full model's code.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

from handpipe.core import LAYERS, under_fat

Part = TypeVar("Part")
CHANGES_OF_FAT = ("without_sliding",)  # that the fat's tissue has, too
BARE = {"bone_fascia": "bones", "muscle_fascia": "muscles"}  # what the fat lies on where a fascia is left out


@dataclass(frozen=True)
class Variant:
    """What differs from the full model.

    Parameters
    ----------
    text : str
        What differs, in a few words.
    without : tuple of str
        Layers that are left out.
    solved : tuple of str
        Layers that are simulated again; the shapes of the others are those of the full model.
    true : tuple of str
        Layers whose shapes are true ones.
    refitted : tuple of str
        Layers whose artifacts are fitted anew, without what is left out.
    change : str
        Method of layers, and of the fat's tissue, that gives the changed one; what lacks it does not change.
    own_strains : bool
        Whether strains of the fat are fitted anew to the scans of the examples: those of the full model
        belong to its organs in these poses. True organs keep them: they tell what the error of the full model
        in held-out poses is made of.
    """

    text: str
    without: tuple[str, ...] = ()
    solved: tuple[str, ...] = ()
    true: tuple[str, ...] = ()
    refitted: tuple[str, ...] = ()
    change: str = ""
    own_strains: bool = True

    @property
    def loaded(self) -> tuple[str, ...]:
        """Layers that its simulation under the fat loads, inside out."""
        return tuple(name for name in LAYERS if name in {*self.solved, *self.true})

    @property
    def under_fat(self) -> tuple[str, ...]:
        """Layers whose bodies the fat lies on."""
        bare = (BARE.get(name) if name in self.without else name for name in under_fat())
        return tuple(name for name in bare if name is not None)

    @property
    def own_fat(self) -> bool:
        """Whether the fat's mesh or constraints are not those of the full model."""
        return self.under_fat != under_fat() or self.change in CHANGES_OF_FAT

    def changed(self, part: Part) -> Part:
        """A layer, or the fat's tissue, as the variant has it; itself where the change is not of its kind."""
        change: Any = getattr(part, self.change, None) if self.change else None
        return part if change is None else change()


OF_SKELETON = (
    "bones",
    "bone_fascia",
    "ligaments",
)  # simulated again with other bones, whatever the organs
VARIANTS = {
    "no_tendons": Variant("no tendons under the fat", without=("tendons",)),
    "no_fasciae": Variant("no fasciae: fat on bare bones and muscles", without=(*BARE,)),
    "no_sliding": Variant("nothing slides: fixed instead", solved=(*BARE,), change="without_sliding"),
    "no_hook_corrections": Variant(
        "hooks without corrections", solved=("tendons",), change="without_corrections"
    ),
    "no_flesh": Variant(
        "no flesh: hooks and muscles follow bones",
        without=("flesh",),
        solved=("tendons", "muscles", "muscle_fascia"),
        refitted=("tendons", "muscles"),
    ),
    "eq1_weights": Variant(
        "weights of Zheng 2022 Eq. 1",
        solved=("tendons", "muscles", "muscle_fascia"),
        change="by_inverse_distance",
        own_strains=False,  # at the examples, where all is fitted, weights are the same
    ),
    "no_separation": Variant(
        "muscles not separated", solved=("muscles", "muscle_fascia"), refitted=("muscles",)
    ),
    "true_bones": Variant(
        "true bones",
        solved=(*OF_SKELETON, "flesh", "tendons", "muscles", "muscle_fascia"),
        true=("bones",),
        own_strains=False,
    ),
    "true_tendons": Variant("true tendons", true=("tendons",), own_strains=False),
    "true_muscles": Variant("true muscles", solved=("muscle_fascia",), true=("muscles",), own_strains=False),
    "true_organs": Variant(
        "true bones, tendons, muscles",
        solved=(*OF_SKELETON, "muscle_fascia"),
        true=("bones", "tendons", "muscles"),
        own_strains=False,
    ),
}
PASSIVE = "_passive"  # ends the name of a variant's skin without strains of the fat
