"""How each layer looks in pictures and exports: one colour and opacity, the same everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from handpipe.core import Array, Look, Shape, Shapes, looks
from handpipe.tissues.tendons import CENTRELINE

OTHER = Look((0.7, 0.7, 0.7))
INSIDE_OF = ("_mesh", CENTRELINE)  # endings of bodies that a surface of the same layer shows
NAIL = (0.95, 0.78, 0.72)  # sRGB of nails, which are marked by the field "nail" of a skin


def tissue(layer: str, body: str) -> str:
    """Name of the look of a body, a key of `colour` and `opacity`.

    A layer that carries the skin has a body "skin"; the volumes around it are fat.

    Parameters
    ----------
    layer : str
        Name of the layer.
    body : str
        Name of the body in the layer.

    Returns
    -------
    str
        "skin", "fat" or the layer's name.
    """
    if body == "skin":
        return "skin"
    return "fat" if layer in ("fat", "skin") else layer


def shown(layers: Mapping[str, Shapes]) -> Iterator[tuple[str, str, Shape]]:
    """Layer, body and shape of all that a picture shows: everything but the fat beneath a skin.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of a frame by layer and body.

    Yields
    ------
    layer, body : str
        Names of the layer and of the body.
    shape : Shape
        Shape of the body.
    """
    skinned = any("skin" in shapes for shapes in layers.values())
    for layer, shapes in layers.items():
        for body, shape in shapes.items():
            if not (skinned and tissue(layer, body) == "fat"):
                yield layer, body, shape


def surfaces_once(layers: Mapping[str, Shapes]) -> Iterator[tuple[str, str, Shape]]:
    """As `shown`, each body once: not the tets or the centre line inside of a surface.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of a frame by layer and body.

    Yields
    ------
    layer, body : str
        Names of the layer and of the body.
    shape : Shape
        Shape of the body.
    """
    for layer, body, shape in shown(layers):
        if not any(body.removesuffix(end) in layers[layer] for end in INSIDE_OF if body.endswith(end)):
            yield layer, body, shape


def colour(look: str) -> tuple[float, float, float]:
    """Colour of a tissue.

    Parameters
    ----------
    look : str
        Name of the tissue, see `tissue`; an unknown one is grey.

    Returns
    -------
    tuple of float
        sRGB in 0..1.
    """
    return looks().get(look, OTHER).colour


def opacity(look: str) -> float:
    """Opacity of a tissue in pictures that show what lies below it.

    Parameters
    ----------
    look : str
        Name of the tissue, see `tissue`; an unknown one is opaque.

    Returns
    -------
    float
        Opacity in 0..1.
    """
    return looks().get(look, OTHER).opacity


def vertex_colours(look: str, shape: Shape) -> Array | None:
    """Colours of the vertices of a body that has several.

    Parameters
    ----------
    look : str
        Name of its tissue, see `tissue`.
    shape : Shape
        The body, with a field "nail" where it has nails.

    Returns
    -------
    array (n, 3) or None
        sRGB in 0..1; None where the whole body has the tissue's `colour`.
    """
    nail = shape.fields.get("nail")
    return None if nail is None else np.where(nail[:, None] > 0, NAIL, colour(look))
