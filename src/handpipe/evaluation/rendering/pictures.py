"""Shaded pictures of surfaces: three lights, ambient occlusion, transparent bodies, cuts, colour bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
import vtkmodules.vtkRenderingFreeType  # noqa: F401  the text of colour bars
from vtkmodules.vtkCommonCore import vtkLookupTable
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import vtkRenderer

from handpipe.core import Array
from handpipe.evaluation.rendering.bodies import Drawable, actors
from handpipe.evaluation.rendering.camera import Camera, Cut
from handpipe.evaluation.rendering.window import SUPERSAMPLING, Image, pixels, window

OCCLUSION = 0.035  # of the picture's height: how far a body darkens what is near it
BIAS = 0.2  # of that distance: nearer surfaces do not darken, which hides the edges of triangles
SAMPLES = 64  # of the neighbourhood of a pixel
PEELS = 8  # sheets of transparent bodies behind one another
COLOUR_MAP = "viridis"
BAR_FONT = 12  # pixels


@dataclass(frozen=True)
class ColourBar:
    """The scale of a field that colours a body.

    Parameters
    ----------
    title : str
        What it shows, with its unit.
    low, high : float
        Values at the ends of the bar.
    """

    title: str
    low: float
    high: float

    def colours(self, values: Array) -> Array:
        """Colours (n, 3) in 0..1 of values (n,), those beyond the ends as the ends."""
        shares = np.clip((np.asarray(values) - self.low) / (self.high - self.low), 0, 1)
        return np.asarray(matplotlib.colormaps[COLOUR_MAP](shares)[..., :3])


def render(
    bodies: Sequence[Drawable],
    camera: Camera,
    size: tuple[int, int] = (640, 480),
    cut: Cut | None = None,
    bar: ColourBar | None = None,
) -> Image:
    """Picture of bodies on white.

    Opaque bodies hide each other and darken what is near them (screen-space ambient occlusion). Three lights
    move with the camera.

    Parameters
    ----------
    bodies : sequence of Drawable
        Bodies to be drawn, at least one. Where the caps of several lie in one place, the first one's is seen.
    camera : Camera
        Projection.
    size : tuple of int
        Width and height in pixels.
    cut : Cut, optional
        Plane that removes one side.
    bar : ColourBar, optional
        Scale to be drawn at the right.

    Returns
    -------
    array (height, width, 3)
        Colours in 0..255.

    Raises
    ------
    InputError
        If the machine has no OpenGL.
    """
    corners = np.concatenate([body.surface.vertices for body in bodies])
    reach = 1.0 + float(np.linalg.norm(corners - camera.centre, axis=1).max())
    with window(camera, size, reach) as renderer:
        for rank, body in enumerate(bodies):
            for actor in actors(body, camera.axes[2], cut, rank):
                renderer.AddActor(actor)
        if any(body.opacity < 1 for body in bodies):
            renderer.UseDepthPeelingOn()
            renderer.SetMaximumNumberOfPeels(PEELS)
            renderer.SetOcclusionRatio(0.0)
        _occlude(renderer, camera)
        if bar is not None:
            renderer.AddViewProp(_drawn(bar))
        return pixels(renderer)


def _occlude(renderer: vtkRenderer, camera: Camera) -> None:
    renderer.UseSSAOOn()
    renderer.SetSSAORadius(OCCLUSION * camera.height)
    renderer.SetSSAOBias(BIAS * OCCLUSION * camera.height)
    renderer.SetSSAOKernelSize(SAMPLES)
    renderer.SSAOBlurOn()


def _drawn(bar: ColourBar) -> vtkScalarBarActor:
    table, drawn = vtkLookupTable(), vtkScalarBarActor()
    steps = 256
    table.SetNumberOfTableValues(steps)
    table.SetRange(bar.low, bar.high)
    for step, rgb in enumerate(bar.colours(np.linspace(bar.low, bar.high, steps))):
        table.SetTableValue(step, [*rgb.tolist(), 1.0])
    drawn.SetLookupTable(table)
    drawn.SetTitle(bar.title)
    drawn.SetNumberOfLabels(3)
    drawn.SetLabelFormat("{:.2g}")
    drawn.SetMaximumNumberOfColors(steps)
    drawn.UnconstrainedFontSizeOn()
    for text in (drawn.GetTitleTextProperty(), drawn.GetLabelTextProperty()):
        text.SetFontSize(BAR_FONT * SUPERSAMPLING)
        text.SetColor(0, 0, 0)
        text.BoldOff()
        text.ItalicOff()
        text.ShadowOff()
    drawn.SetPosition(0.86, 0.2)
    drawn.SetWidth(0.1)
    drawn.SetHeight(0.6)
    return drawn
