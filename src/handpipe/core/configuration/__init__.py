"""What a person decides: datasets, scenes, settings, their schemas, the part that a stage reads."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.core.configuration import selection
    from handpipe.core.configuration.anatomy import Joint, Muscle
    from handpipe.core.configuration.dataset import Dataset, Interpolation, Segmentation, load_dataset
    from handpipe.core.configuration.images import ImageEffect, Images, Scanner, Strength
    from handpipe.core.configuration.loading import checked, every_fault, load_yaml
    from handpipe.core.configuration.model import Length, Model, Name, Vector
    from handpipe.core.configuration.pose import Role
    from handpipe.core.configuration.scene import Recording, Scene, load_scene
    from handpipe.core.configuration.selection import restored
    from handpipe.core.configuration.settings import EDGES, require_fidelity, settings_of
    from handpipe.core.configuration.tree_order import joint_order
else:
    __getattr__ = face(__name__)

__all__ = [
    "Dataset",
    "EDGES",
    "ImageEffect",
    "Images",
    "Interpolation",
    "Joint",
    "Length",
    "Model",
    "Muscle",
    "Name",
    "Recording",
    "Role",
    "Scanner",
    "Scene",
    "Segmentation",
    "Strength",
    "Vector",
    "checked",
    "every_fault",
    "joint_order",
    "load_dataset",
    "load_scene",
    "load_yaml",
    "require_fidelity",
    "restored",
    "selection",
    "settings_of",
]
