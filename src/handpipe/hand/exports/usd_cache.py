"""A scene's frames as USD: bones as moving transforms, soft bodies as meshes with moving points."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import Array, InputError, IntArray, RigidTransform, Shape, atomic
from handpipe.hand.appearance import colour, surfaces_once, tissue
from handpipe.hand.exports.export import surface_triangles
from handpipe.hand.simulation import SimulatedFrame

ROOT = "/Hand"
MILLIMETRE = 0.001  # m
GAMMA = 2.2  # of screens: colours in USD are linear light


def write_usd(path: str | Path, frames: Iterable[SimulatedFrame], fps: float = 24.0) -> None:
    """Write all frames as one USD file, mm, z up.

    A bone is a transform with a sample a frame, and its mesh is stored once, in neutral. Every other body is
    a mesh whose points (float32) have a sample a frame and whose triangles are stored once. Tets and
    centrelines inside of a surface are left out, as are lines. A frame's time code is its number.

    Parameters
    ----------
    path : path
        File to be written, `.usdc`.
    frames : iterable of SimulatedFrame
        Frames in the order of time; one is in memory at a time, and the points of all.
    fps : float
        Frames per second.

    Raises
    ------
    InputError
        Where the library usd-core is not installed.
    """
    try:
        from pxr import Usd, UsdGeom
    except ImportError as error:
        remedy = "Run: pip install 'handpipe[usd]'"
        raise InputError(path, "USD", "the library usd-core is not installed", remedy) from error
    with atomic(path) as temporary:
        stage = Usd.Stage.CreateNew(str(temporary))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(stage, MILLIMETRE)
        stage.SetTimeCodesPerSecond(fps)
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
        writer, time = _Writer(stage), 0
        for time, (frame, layers) in enumerate(frames):
            for layer, body, shape in surfaces_once(layers):
                if shape.cells.shape[1] == 2:
                    continue
                if layer == "bones" and body in frame.bones:
                    writer.bone(body, shape, frame.bones[body], time)
                else:
                    writer.soft(layer, body, shape, time)
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(time)
        stage.GetRootLayer().Save()


class _Writer:
    """Adds bodies to a stage, each with its triangles once."""

    def __init__(self, stage: Any) -> None:
        from pxr import UsdGeom

        self.stage, self.geometry = stage, UsdGeom
        self.moves: dict[str, Any] = {}
        self.meshes: dict[tuple[str, str], tuple[Any, IntArray]] = {}

    def bone(self, body: str, shape: Shape, motion: RigidTransform, time: int) -> None:
        """Add a bone's transform at a time."""
        from pxr import Gf

        if body not in self.moves:
            place = self.geometry.Xform.Define(self.stage, f"{ROOT}/bones/{body}")
            self.moves[body] = place.AddTransformOp()
            mesh, used = self._mesh(f"{ROOT}/bones/{body}/mesh", "bones", body, shape)
            _place(mesh, shape.rest[used], None)
        matrix = np.eye(4)  # of row vectors
        matrix[:3, :3], matrix[3, :3] = motion.rotation.T, motion.translation
        self.moves[body].Set(Gf.Matrix4d(matrix), time)

    def soft(self, layer: str, body: str, shape: Shape, time: int) -> None:
        """Add a body's points at a time."""
        if (layer, body) not in self.meshes:
            self.meshes[layer, body] = self._mesh(f"{ROOT}/{layer}/{body}", layer, body, shape)
        mesh, used = self.meshes[layer, body]
        _place(mesh, shape.vertices[used], time)

    def _mesh(self, path: str, layer: str, body: str, shape: Shape) -> tuple[Any, IntArray]:
        """A mesh without points, and the vertices that its triangles use."""
        from pxr import Gf, Vt

        mesh = self.geometry.Mesh.Define(self.stage, path)
        used, local = np.unique(surface_triangles(shape.cells), return_inverse=True)
        indices = np.asarray(local, np.int32).ravel()
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(indices) // 3, 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
        mesh.CreateSubdivisionSchemeAttr("none")
        linear = [c**GAMMA for c in colour(tissue(layer, body))]
        mesh.CreateDisplayColorAttr([Gf.Vec3f(*linear)])
        return mesh, used


def _place(mesh: Any, points: Array, time: int | None) -> None:
    """Give a mesh its points and its box, at a time or for all times."""
    from pxr import Usd, Vt

    when = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
    single = np.ascontiguousarray(points, np.float32)
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(single), when)
    box = np.stack([single.min(axis=0), single.max(axis=0)])
    mesh.GetExtentAttr().Set(Vt.Vec3fArray.FromNumpy(box), when)
