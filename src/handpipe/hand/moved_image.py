"""The neutral image of a hand in motion: each voxel of a simulated frame and its place in neutral."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from handpipe.core import LAYERS, Frame, InputError, RigidTransform, Shape, Shapes
from handpipe.imaging.volumes import Volume, rasterise
from handpipe.imaging.warping import BackwardField, Places
from handpipe.mesh.surfaces import Surface

BORDER = 2  # voxels of a grid around the skin
Moved = Mapping[str, Shapes]


def skin_of(layers: Moved) -> Surface:
    """The closed skin of a simulated frame.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of the frame by layer and body.

    Returns
    -------
    Surface
        In mm, the root bone at rest.

    Raises
    ------
    InputError
        If no layer has a skin.
    """
    for shapes in layers.values():
        if "skin" in shapes:
            return Surface(shapes["skin"].vertices, shapes["skin"].cells)
    problem = f"no skin among {', '.join(layers)}, which bounds the image"
    raise InputError("frame", "layers", problem, "Add fat or skin to the scene's layers")


def grid_around(skins: Sequence[Surface], spacing: float) -> Volume:
    """An empty grid along the axes around all skins.

    Parameters
    ----------
    skins : sequence of Surface
        Skins in mm.
    spacing : float
        Size of its cubic voxels in mm.

    Returns
    -------
    Volume
        All zero, with a border of two voxels.
    """
    lower = np.min([s.vertices.min(axis=0) for s in skins], axis=0) - BORDER * spacing
    upper = np.max([s.vertices.max(axis=0) for s in skins], axis=0) + BORDER * spacing
    affine = np.diag([spacing, spacing, spacing, 1.0])
    affine[:3, 3] = lower
    shape = tuple(np.ceil((upper - lower) / spacing).astype(int) + 1)
    return Volume(np.zeros(shape, np.float32), affine)


def places_in_neutral(
    grid: Volume, frame: Frame, layers: Moved, to_grid: RigidTransform | None = None
) -> Places:
    """Where each voxel inside the skin of a simulated frame was in neutral.

    Bones are rigid. Muscles, ligaments and fat tell by the barycentric weights of their tets, tendons and
    fasciae by their vertices; between them the displacement is harmonic.

    Parameters
    ----------
    grid : Volume
        Grid of the moved image; its values are not read.
    frame : Frame
        The frame, whose transforms take the bones.
    layers : mapping of str to Shapes
        Its shapes by layer and body, with a skin.
    to_grid : RigidTransform, optional
        From the simulation's frame, the root bone at rest, to that of the grid; by default they are one.

    Returns
    -------
    Places
        Of every voxel whose centre is inside the skin.

    Raises
    ------
    InputError
        If no layer has a skin.
    ConvergenceError
        If the harmonic displacement is not found.

    References
    ----------
    Zheng 2022 §8, Figs. 1, 2.
    """
    root = RigidTransform.identity() if to_grid is None else to_grid
    skin = skin_of(layers)
    field = BackwardField(grid, rasterise(grid, {1: skin.moved(root(skin.vertices))}) > 0)
    for bone, shape in layers.get("bones", {}).items():
        moved = Surface(root(shape.vertices), shape.cells)
        field.add_rigid(moved, (root @ frame.bones[bone]).inverse())
    _add_tissues(field, layers, root)
    return field.filled()


def _add_tissues(field: BackwardField, layers: Moved, root: RigidTransform) -> None:
    """Tendons, then what has tets under the fat, then surfaces; of the fat what is outside of all these."""
    inner, outer = _organs(layers, "inner"), _organs(layers, "outer")
    for shape in layers.get("tendons", {}).values():
        field.add_points(root(shape.vertices), shape.rest)
    _add(field, inner, root)
    for shape in inner:
        if shape.cells.shape[1] == 3:
            field.reserve(Surface(root(shape.vertices), shape.cells))
    _add(field, outer, root)


def _add(field: BackwardField, shapes: Sequence[Shape], root: RigidTransform) -> None:
    """Bodies with tets before surfaces and lines."""
    for shape in sorted(shapes, key=lambda s: -s.cells.shape[1]):
        if shape.cells.shape[1] == 4:
            field.add_tets(root(shape.vertices), shape.rest, shape.cells)
        else:
            field.add_points(root(shape.vertices), shape.rest)


def _organs(layers: Moved, role: str) -> list[Shape]:
    """Shapes of the layers of a role but for the bones."""
    chosen = [found for name, found in layers.items() if name != "bones" and LAYERS[name].role == role]
    return [shape for shapes in chosen for shape in shapes.values()]
