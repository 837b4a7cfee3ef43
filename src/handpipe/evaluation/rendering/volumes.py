"""Volume rendering of magnetic resonance images with transfer functions of intensity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  the mapper's implementation
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkColorTransferFunction, vtkVolume, vtkVolumeProperty
from vtkmodules.vtkRenderingVolume import vtkGPUVolumeRayCastMapper

from handpipe.core import Array
from handpipe.evaluation.rendering.camera import Camera
from handpipe.evaluation.rendering.window import Image, pixels, window
from handpipe.imaging.volumes import Volume

STEPS = 2.0  # samples of a ray per voxel
AMBIENT, DIFFUSE = 0.55, 0.60  # shares of light


@dataclass(frozen=True)
class Transfer:
    """Colour and opacity of intensities.

    Parameters
    ----------
    points : sequence of (float, (float, float, float), float)
        Intensity as a share of the image's bright tissue, colour in 0..1, and opacity of 1 mm; linear in
        between.
    """

    points: Sequence[tuple[float, tuple[float, float, float], float]]


TRANSFERS: Mapping[str, Transfer] = {
    "anatomy": Transfer(  # muscle is grey, fat and marrow are bright, cortex and tendons as dark as air
        points=(
            (0.00, (0.00, 0.00, 0.00), 0.00),
            (0.22, (0.70, 0.25, 0.22), 0.00),
            (0.32, (0.82, 0.30, 0.26), 0.35),
            (0.58, (0.88, 0.42, 0.35), 0.35),
            (0.70, (0.98, 0.88, 0.70), 0.02),
            (1.00, (1.00, 0.96, 0.86), 0.05),
        ),
    ),
    "fat": Transfer(
        points=(
            (0.00, (0.00, 0.00, 0.00), 0.00),
            (0.65, (0.85, 0.60, 0.35), 0.00),
            (0.80, (0.98, 0.80, 0.35), 0.12),
            (1.00, (1.00, 0.93, 0.60), 0.35),
        ),
    ),
}


def render_volume(
    volume: Volume, transfer: Transfer, bright: float, camera: Camera, size: tuple[int, int] = (640, 480)
) -> Image:
    """Picture of a volume on white.

    Parameters
    ----------
    volume : Volume
        The image, mm.
    transfer : Transfer
        Colours and opacities of its intensities.
    bright : float
        Intensity of bright tissue, `Volume.bright`; one figure for all images of a movie.
    camera : Camera
        Projection.
    size : tuple of int
        Width and height in pixels.

    Returns
    -------
    array (height, width, 3)
        Colours in 0..255.

    Raises
    ------
    InputError
        If the machine has no OpenGL.
    """
    far = np.linalg.norm(volume_extent(volume) - camera.centre, axis=1).max()
    with window(camera, size, 1.0 + float(far)) as renderer:
        renderer.AddVolume(_drawn(volume, transfer, bright))
        return pixels(renderer)


def volume_extent(volume: Volume) -> Array:
    """The corners of a volume, for a camera that sees all of it.

    Parameters
    ----------
    volume : Volume
        The image, mm.

    Returns
    -------
    array (8, 3)
        World points in mm: centres of the voxels at its corners.
    """
    ends = np.array(np.meshgrid(*[(0, n - 1) for n in volume.shape])).reshape(3, -1).T
    return volume.to_world(ends)


def _drawn(volume: Volume, transfer: Transfer, bright: float) -> vtkVolume:
    image, mapper, look, drawn = vtkImageData(), vtkGPUVolumeRayCastMapper(), vtkVolumeProperty(), vtkVolume()
    image.SetDimensions(*volume.shape)
    image.SetSpacing(*volume.spacing)
    shares = np.ravel(volume.values / bright, order="F").astype(np.float32)
    image.GetPointData().SetScalars(numpy_to_vtk(shares, deep=True))
    mapper.SetInputData(image)
    mapper.AutoAdjustSampleDistancesOff()
    mapper.SetSampleDistance(float(volume.spacing.min()) / STEPS)
    colour, opacity = vtkColorTransferFunction(), vtkPiecewiseFunction()
    for share, rgb, alpha in transfer.points:
        colour.AddRGBPoint(share, *rgb)
        opacity.AddPoint(share, alpha)
    look.SetColor(colour)
    look.SetScalarOpacity(opacity)
    look.SetScalarOpacityUnitDistance(1.0)
    look.SetInterpolationTypeToLinear()
    look.ShadeOn()
    look.SetAmbient(AMBIENT)
    look.SetDiffuse(DIFFUSE)
    look.SetSpecular(0.0)
    drawn.SetMapper(mapper)
    drawn.SetProperty(look)
    drawn.SetUserMatrix(_placed(volume))
    return drawn


def _placed(volume: Volume) -> vtkMatrix4x4:
    """From VTK's mm along the voxels to world mm."""
    found = np.eye(4)
    found[:3, :3] = volume.affine[:3, :3] / volume.spacing
    found[:3, 3] = volume.affine[:3, 3]
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(found.ravel().tolist())
    return matrix
