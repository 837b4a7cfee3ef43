"""Pictures of a simulated pose: skin, organs beneath it, error colours, slices with contours."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image as PillowImage

from handpipe.core import LAYERS, Array, Shape, Shapes
from handpipe.evaluation.rendering import Camera, ColourBar, Cut, Drawable, Image, render
from handpipe.evaluation.slices import Contours, Plane, Sample, draw_slice
from handpipe.evaluation.surfaces import surface_distance
from handpipe.hand import colour, opacity, shown, surface_triangles, tissue, vertex_colours
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.tendons.rods import round_surface

ROD_RADIUS = 1.0  # mm, of a tendon that is given as a line
LIFT = 0.8  # mm towards the camera, of a cloth: the distance within which it lies on organs
GHOST = 0.18  # opacity of the skin around the organs
CONTOUR_COLOURS = {  # skin and muscles as in Zheng 2022, Fig. 32
    "skin": "#19e03c",
    "muscles": "#ffd500",
    "bones": "#35d6ff",
    "tendons": "#ff8a1f",
    "ligaments": "#ff5ad1",
}


def body_surface(shape: Shape) -> Surface:
    """The surface of a body: its triangles, its tetrahedra's boundary, or a tube about its segments."""
    if shape.cells.shape[1] == 2:
        return round_surface(shape.vertices, ROD_RADIUS, sides=10)
    return Surface(shape.vertices, surface_triangles(shape.cells)).compact()


def bodies(
    layers: Mapping[str, Shapes], *, skin_opacity: float | None = None, cloths: bool = True
) -> list[Drawable]:
    """Bodies of a frame to be drawn, in the colours of their tissues.

    Cloths are drawn `LIFT` nearer to the camera, since they touch the organs that they lie on.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of the frame by layer and body.
    skin_opacity : float, optional
        Opacity of the skin in 0..1; None leaves the skin out.
    cloths : bool
        Whether to draw the fasciae.

    Returns
    -------
    list of Drawable
        Surfaces in mm with colour and opacity, inside out, without the fat beneath a skin. The section of the
        skin has the colour of fat.
    """
    drawn = []
    for layer, body, shape in shown(layers):
        look = tissue(layer, body)
        if look == "skin":
            if skin_opacity is not None:
                vertex_rgb = surface_colours(look, shape) if skin_opacity == 1 else None
                rgb = colour(look) if vertex_rgb is None else vertex_rgb
                surface = body_surface(shape)
                drawn.append(Drawable(surface, rgb, skin_opacity, cap=colour("fat"), scattering=True))
        elif opacity(look) == 1:
            drawn.append(Drawable(body_surface(shape), colour(look)))
        elif cloths:
            drawn.append(Drawable(body_surface(shape), colour(look), opacity(look), LIFT))
    return drawn


def surface_colours(look: str, shape: Shape) -> Array | None:
    """Colours (n, 3) of the vertices of its `body_surface`, None where all have the tissue's one."""
    rgb = vertex_colours(look, shape)
    return None if rgb is None else rgb[np.unique(surface_triangles(shape.cells))]


def extent(layers: Mapping[str, Shapes]) -> Array:
    """Vertices of all that a picture of a frame shows.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of the frame by layer and body.

    Returns
    -------
    array (n, 3)
        Points in mm.
    """
    return np.concatenate([shape.vertices for _, _, shape in shown(layers)])


def skin_surface(layers: Mapping[str, Shapes]) -> Surface | None:
    """The simulated skin of a frame, None where it has none."""
    found = [s for layer, body, s in shown(layers) if tissue(layer, body) == "skin"]
    return body_surface(found[0]) if found else None


def outer_picture(layers: Mapping[str, Shapes], camera: Camera, size: tuple[int, int]) -> Image:
    """The frame from outside, skin opaque.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of the frame by layer and body.
    camera : Camera
        Projection.
    size : tuple of int
        Width and height in pixels.

    Returns
    -------
    array (height, width, 3)
        Colours in 0..255, on white.
    """
    return render(bodies(layers, skin_opacity=1.0), camera, size)


def inner_picture(
    layers: Mapping[str, Shapes], camera: Camera, size: tuple[int, int], *, cloths: bool = False
) -> Image:
    """The organs, the skin transparent.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of the frame by layer and body.
    camera : Camera
        Projection.
    size : tuple of int
        Width and height in pixels.
    cloths : bool
        Whether to draw the fasciae.

    Returns
    -------
    array (height, width, 3)
        Colours in 0..255, on white.
    """
    return render(bodies(layers, skin_opacity=GHOST, cloths=cloths), camera, size)


def cut_picture(layers: Mapping[str, Shapes], camera: Camera, size: tuple[int, int], cut: Cut) -> Image:
    """The frame cut open, skin opaque, without fasciae.

    Parameters
    ----------
    layers : mapping of str to Shapes
        Shapes of the frame by layer and body.
    camera : Camera
        Projection.
    size : tuple of int
        Width and height in pixels.
    cut : Cut
        Plane that removes one side.

    Returns
    -------
    array (height, width, 3)
        Colours in 0..255, on white.
    """
    return render(bodies(layers, skin_opacity=1.0, cloths=False), camera, size, cut)


def error_picture(
    scan: Surface, skin: Surface, camera: Camera, size: tuple[int, int], largest: float
) -> Image:
    """Scanned skin coloured by its distance to the simulated one, 0 to `largest` mm (Zheng 2022, Fig. 30)."""
    bar = ColourBar("mm", 0.0, largest)
    rgb = bar.colours(surface_distance(scan.vertices, skin))
    return render([Drawable(scan, rgb)], camera, size, bar=bar)


def contours(layers: Mapping[str, Shapes], truth: Mapping[str, Sequence[Surface]]) -> list[Contours]:
    """Contours of a frame's tissues, full lines, and of the true ones, dotted."""
    simulated: dict[str, list[Surface]] = {}
    for layer, body, shape in shown(layers):
        simulated.setdefault(tissue(layer, body), []).append(body_surface(shape))
    drawn = [Contours(k, s, CONTOUR_COLOURS[k]) for k, s in simulated.items() if k in CONTOUR_COLOURS]
    drawn += [
        Contours(f"{k}, truth", s, CONTOUR_COLOURS[k], ":") for k, s in truth.items() if k in CONTOUR_COLOURS
    ]
    return drawn


def slices_figure(sample: Sample | None, planes: Mapping[str, Plane], drawn: Sequence[Contours]) -> Figure:
    """Slices side by side under their names, with one legend."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    ratios = [1.0 if title.startswith("transversal") else 2.0 for title in planes]
    axes = figure.subplots(1, len(planes), squeeze=False, width_ratios=ratios)[0]
    seen: set[str] = set()
    for ax, (title, plane) in zip(axes, planes.items(), strict=True):
        seen |= {name for name, segments in draw_slice(ax, sample, plane, drawn).items() if len(segments)}
        ax.set_title(title, fontsize=9)
        ax.tick_params(labelsize=8)
        if sample is None:
            ax.set_facecolor("#222222")
    handles = [
        Line2D([], [], color=c.colour, linestyle=c.style, label=c.name) for c in drawn if c.name in seen
    ]
    if handles:
        legend = figure.legend(
            handles=handles, loc="outside lower center", ncols=8, fontsize=9, facecolor="#333333"
        )
        for text in legend.get_texts():
            text.set_color("white")
    return figure


def legend(looks: Sequence[str]) -> list[tuple[str, str]]:
    """Name and CSS colour of each tissue, in the order of the layers."""
    order = [look for look in LAYERS if look in looks] + [look for look in looks if look not in LAYERS]
    return [(look.replace("_", " "), _css(colour(look))) for look in order]


def _css(rgb: tuple[float, float, float]) -> str:
    return "#" + "".join(f"{round(255 * c):02x}" for c in rgb)


def png(picture: Image | Figure) -> bytes:
    """A picture or figure as a PNG.

    Parameters
    ----------
    picture : array (h, w, 3) or Figure
        Colours in 0..255, or a figure of matplotlib.

    Returns
    -------
    bytes
        Content of a file.
    """
    file = io.BytesIO()
    if isinstance(picture, Figure):
        FigureCanvasAgg(picture)
        picture.savefig(file, format="png", dpi=110)
    else:
        PillowImage.fromarray(picture).save(file, format="png", optimize=True)
    return file.getvalue()
