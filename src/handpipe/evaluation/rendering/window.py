"""VTK's window without a screen: OpenGL on the processor by EGL or OSMesa, lights, pixels."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
from numpy.typing import NDArray
from vtkmodules import vtkRenderingOpenGL2
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkObject, vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkLight, vtkRenderer, vtkRenderWindow

from handpipe.core import Array, InputError
from handpipe.evaluation.rendering.camera import Camera

Image = NDArray[np.uint8]

SUPERSAMPLING = 2  # pixels drawn per pixel and direction
LIGHTS = (  # key, fill and rim: place before the camera (right, up, towards it), colour, intensity
    ((-0.8, 0.9, 1.0), (1.0, 0.97, 0.93), 0.85),
    ((1.0, 0.1, 0.8), (0.90, 0.94, 1.0), 0.40),
    ((0.3, 0.8, -1.0), (1.0, 0.98, 0.95), 0.35),
)
KINDS = {  # windows on Linux, in this order, and the libraries of which each needs one
    "vtkEGLRenderWindow": ("libEGL.so.1",),
    "vtkOSOpenGLRenderWindow": ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),
}


@contextmanager
def window(camera: Camera, size: tuple[int, int], reach: float) -> Iterator[vtkRenderer]:
    """A white picture that shows what lies within `reach` mm of the camera's centre, three lights on it."""
    made = _kind()()
    made.SetOffScreenRendering(1)
    made.SetMultiSamples(0)
    made.SetSize(size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING)
    renderer = vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    made.AddRenderer(renderer)
    _aim(renderer, camera, reach)
    renderer.AutomaticLightCreationOff()
    for place, rgb, intensity in LIGHTS:
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*place)
        light.SetFocalPoint(0, 0, 0)
        light.SetColor(*rgb)
        light.SetIntensity(intensity)
        renderer.AddLight(light)
    try:
        yield renderer
    finally:
        made.Finalize()


def pixels(renderer: vtkRenderer) -> Image:
    """The picture (h, w, 3), rows from the top."""
    made = renderer.GetRenderWindow()
    made.Render()
    width, height = made.GetSize()
    found = vtkUnsignedCharArray()
    made.GetPixelData(0, 0, width - 1, height - 1, 0, found, 0)
    fine = vtk_to_numpy(found).reshape(height, width, 3)[::-1]
    step = SUPERSAMPLING
    mean = fine.reshape(height // step, step, width // step, step, 3).mean(axis=(1, 3))
    return np.round(mean).astype(np.uint8)


@cache
def _kind() -> type[vtkRenderWindow]:
    """The kind of window that draws on this machine."""
    if sys.platform != "linux":
        return vtkRenderWindow
    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        for name, libraries in KINDS.items():
            kind = getattr(vtkRenderingOpenGL2, name)
            if any(map(_loads, libraries)) and kind().SupportsOpenGL():
                return kind
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
    raise InputError(
        "OpenGL",
        "libEGL.so.1",
        "neither it nor OSMesa draws on this machine",
        "Install them, on Debian: apt-get install libegl1 libgl1-mesa-dri",
    )


def _loads(library: str) -> bool:
    """Whether a library is there. VTK crashes where it is not."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _aim(renderer: vtkRenderer, camera: Camera, reach: float) -> None:
    _, up, forward = camera.axes
    centre, made = np.asarray(camera.centre, float), renderer.GetActiveCamera()
    made.ParallelProjectionOn()
    made.SetFocalPoint(*centre)
    made.SetPosition(*_before(centre, forward, 2 * reach))
    made.SetViewUp(*up)
    made.SetParallelScale(camera.height / 2)
    made.SetClippingRange(reach, 3 * reach)


def _before(centre: Array, forward: Array, distance: float) -> Array:
    return np.asarray(centre - distance * forward)
