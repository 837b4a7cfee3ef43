"""Other models of the skin, and variants of the full one, that the full model is compared with."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.baselines import (
        evaluate_ablations,
        evaluate_baselines,
        knuckles,
        mesh_ablated_fat,
        simulate_ablated_inner,
        simulate_ablated_skin,
        simulate_baselines,
        simulate_passive_skin,
        variants,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "evaluate_ablations",
    "evaluate_baselines",
    "knuckles",
    "mesh_ablated_fat",
    "simulate_ablated_inner",
    "simulate_ablated_skin",
    "simulate_baselines",
    "simulate_passive_skin",
    "variants",
]
