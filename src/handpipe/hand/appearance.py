"""How each layer looks in pictures and exports: one colour and opacity, the same everywhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from handpipe.layers import Shape, Shapes

COLOURS: dict[str, tuple[float, float, float]] = {
    "bones": (0.93, 0.89, 0.77),
    "bone_fascia": (0.62, 0.76, 0.88),
    "tendons": (0.55, 0.72, 0.93),
    "muscles": (0.78, 0.27, 0.25),
    "muscle_fascia": (0.86, 0.62, 0.66),
    "ligaments": (0.45, 0.70, 0.52),
    "fat": (0.96, 0.80, 0.42),
    "skin": (0.91, 0.71, 0.60),
}
OTHER = (0.7, 0.7, 0.7)
OPACITIES: dict[str, float] = {"bone_fascia": 0.35, "muscle_fascia": 0.35, "fat": 0.3, "skin": 0.3}


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
    return COLOURS.get(look, OTHER)


def opacity(look: str) -> float:
    """The tissue's opacity where what lies below it is to be seen."""
    return OPACITIES.get(look, 1.0)
