"""How each layer looks in pictures and exports: one colour and opacity, the same everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from handpipe.core import Look, Shape, Shapes, looks

OTHER = Look((0.7, 0.7, 0.7))


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
