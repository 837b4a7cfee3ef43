"""Fascia, skin and fat: meshes, strains, comparison with scans."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.tissues import (
        collect_fat_strains,
        evaluate_skin,
        extract_skin,
        fit_fat_strains,
        make_bone_fascia,
        make_muscle_fascia,
        make_skin,
        mesh_crease_tissue,
        mesh_fat,
        mesh_soft_tissue,
        simulate_skin,
        tissue,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "collect_fat_strains",
    "evaluate_skin",
    "extract_skin",
    "fit_fat_strains",
    "make_bone_fascia",
    "make_muscle_fascia",
    "make_skin",
    "mesh_crease_tissue",
    "mesh_fat",
    "mesh_soft_tissue",
    "simulate_skin",
    "tissue",
]
