"""How each layer looks in pictures and exports: one colour and opacity, the same everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from handpipe.core import Look, Shape, Shapes, looks

OTHER = Look((0.7, 0.7, 0.7))


def tissue(layer: str, body: str) -> str:
    """What a body looks like: a layer that carries the skin has a body "skin"; volumes around it are fat."""
    if body == "skin":
        return "skin"
    return "fat" if layer in ("fat", "skin") else layer


def shown(layers: Mapping[str, Shapes]) -> Iterator[tuple[str, str, Shape]]:
    """Layer, body and shape of what a picture shows: everything but the fat beneath a skin."""
    skinned = any("skin" in shapes for shapes in layers.values())
    for layer, shapes in layers.items():
        for body, shape in shapes.items():
            if not (skinned and tissue(layer, body) == "fat"):
                yield layer, body, shape


def colour(look: str) -> tuple[float, float, float]:
    """The tissue's colour, sRGB in 0..1."""
    return looks().get(look, OTHER).colour


def opacity(look: str) -> float:
    """The tissue's opacity where what lies below it is to be seen."""
    return looks().get(look, OTHER).opacity
