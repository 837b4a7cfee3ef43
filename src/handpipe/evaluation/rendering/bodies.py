"""Bodies as VTK draws them: smooth normals, colours, sections at a cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPlane, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkCutter
from vtkmodules.vtkFiltersGeneral import vtkContourTriangulator
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

from handpipe.core import Array
from handpipe.evaluation.rendering.camera import Cut
from handpipe.evaluation.rendering.window import LIGHTS
from handpipe.mesh.surfaces import Surface

AMBIENT, DIFFUSE, SPECULAR, GLOSS = 0.30, 0.80, 0.12, 20.0  # shares of light; exponent of the highlight
LIT = "//VTK::Light::Impl"  # where VTK puts the code of its lights in a shader
# Light enters the skin and leaves it millimetres away, red farthest: that brightens the rim of the shade.
BLEED = (0.16, 0.045, 0.02)  # red, green and blue added there, of the colour of the body
RIM, SPREAD = 0.05, 0.35  # cosine to the key light in the middle of that rim; cosines to where it has faded
SCATTERED = f"""
  float towards = dot(normalVCVSOutput, normalize(vec3{LIGHTS[0][0]}));
  float rim = exp(-pow((towards - {RIM}) / {SPREAD}, 2.0));
  gl_FragData[0].rgb += rim * vec3{BLEED} * diffuseColor;
"""
CAP_STEP = 1e-3  # mm between the caps of bodies that lie in one another, so that the first one is in front


@dataclass(frozen=True)
class Drawable:
    """A surface to be drawn.

    Parameters
    ----------
    surface : Surface
        Triangles in mm.
    rgb : array (3,) or (n, 3)
        Colour in 0..1, of the whole body or of each of its n vertices.
    opacity : float
        Opacity in 0..1. Only the side that faces the camera of a transparent body is drawn.
    lift : float
        mm by which the body is drawn nearer to the camera. A transparent cloth with a lift covers the organs
        that it lies on evenly, also where it touches or penetrates them. Its place in the picture is the
        same, since the projection is parallel.
    cap : array (3,), optional
        Colour of the section at a cut; by default `rgb`, or its mean.
    scattering : bool
        Whether light scatters below the surface, as in skin: it fades slowly and reddish into the shade.
    """

    surface: Surface
    rgb: Array | tuple[float, float, float]
    opacity: float = 1.0
    lift: float = 0.0
    cap: Array | tuple[float, float, float] | None = None
    scattering: bool = False

    @property
    def cap_rgb(self) -> Array:
        """Colour (3,) of its section."""
        return np.asarray(self.rgb if self.cap is None else self.cap, float).reshape(-1, 3).mean(axis=0)


def actors(body: Drawable, forward: Array, cut: Cut | None, rank: int) -> list[vtkActor]:
    """What VTK draws of a body: its surface and its cap at a cut. Of caps in one place rank 0 is in front."""
    data, plane = _polydata(body), _plane(cut)
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    if plane is not None:
        mapper.AddClippingPlane(plane)
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.SetPosition(*(-body.lift * forward))
    look = actor.GetProperty()
    look.SetInterpolationToPhong()
    look.SetAmbient(AMBIENT)
    look.SetDiffuse(DIFFUSE)
    look.SetSpecular(SPECULAR)
    look.SetSpecularPower(GLOSS)
    look.SetOpacity(body.opacity)
    if body.scattering:
        actor.GetShaderProperty().AddFragmentShaderReplacement(LIT, True, LIT + SCATTERED, False)
    if body.opacity < 1:
        look.BackfaceCullingOn()
    if plane is None or body.opacity < 1 or not body.surface.is_closed():
        return [actor]
    return [actor, _cap(data, plane, body.cap_rgb, rank)]


def _polydata(body: Drawable) -> vtkPolyData:
    vertices, triangles = body.surface.vertices, body.surface.triangles
    points, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices, np.float32), deep=True))
    starts = np.arange(0, 3 * len(triangles) + 1, 3, dtype=np.int64)
    corners = np.ascontiguousarray(triangles, np.int64).ravel()
    cells.SetData(numpy_to_vtkIdTypeArray(starts, deep=True), numpy_to_vtkIdTypeArray(corners, deep=True))
    data.SetPoints(points)
    data.SetPolys(cells)
    normals = np.ascontiguousarray(body.surface.vertex_normals(), np.float32)
    data.GetPointData().SetNormals(numpy_to_vtk(normals, deep=True))
    rgb = np.broadcast_to(np.asarray(body.rgb, float), (len(vertices), 3))
    rgb = np.ascontiguousarray(np.round(255 * np.clip(rgb, 0, 1)), np.uint8)
    data.GetPointData().SetScalars(numpy_to_vtk(rgb, deep=True))
    return data


def _plane(cut: Cut | None) -> vtkPlane | None:
    """The plane as VTK wants it: its normal points to what is kept."""
    if cut is None:
        return None
    plane = vtkPlane()
    plane.SetOrigin(*np.asarray(cut.point, float))
    plane.SetNormal(*(-_unit(cut.normal)))
    return plane


def _cap(data: vtkPolyData, plane: vtkPlane, rgb: Array, rank: int) -> vtkActor:
    """The section of a closed surface in one colour without light."""
    cutter, filler, mapper, actor = vtkCutter(), vtkContourTriangulator(), vtkPolyDataMapper(), vtkActor()
    cutter.SetInputData(data)
    cutter.SetCutFunction(plane)
    filler.SetInputConnection(cutter.GetOutputPort())
    mapper.SetInputConnection(filler.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor.SetMapper(mapper)
    actor.SetPosition(*(CAP_STEP * rank * np.array(plane.GetNormal())))
    actor.GetProperty().SetColor(*rgb)
    actor.GetProperty().LightingOff()
    return actor


def _unit(vector: Array) -> Array:
    return np.asarray(vector, float) / np.linalg.norm(vector)
