"""Shaded pictures of surfaces without a graphics card: parallel rays, Embree, headlight and ambient light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Surface

Image = NDArray[np.uint8]

AMBIENT, HEADLIGHT, SIDELIGHT = 0.35, 0.55, 0.20  # shares of light
SUPERSAMPLING = 2  # rays per pixel and direction
TILE = 1 << 18  # rays in flight: bounds the memory of a large picture


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
        Opacity in 0..1.
    """

    surface: Surface
    rgb: Array | tuple[float, float, float]
    opacity: float = 1.0


@dataclass(frozen=True)
class Camera:
    """Parallel projection.

    Parameters
    ----------
    centre : array (3,)
        Point in mm in the middle of the picture.
    direction : array (3,)
        Direction in which the camera looks.
    up : array (3,)
        Direction that points upwards in the picture as far as `direction` allows.
    height : float
        Height in mm of the picture.
    """

    centre: Array
    direction: Array
    up: Array
    height: float

    @staticmethod
    def fit(
        bodies: Sequence[Drawable], direction: Array, up: Array, size: tuple[int, int], margin: float = 1.06
    ) -> Camera:
        """The smallest camera that sees all bodies.

        Parameters
        ----------
        bodies : sequence of Drawable
            Bodies to be seen.
        direction, up : array (3,)
            As in `Camera`.
        size : tuple of int
            Width and height of the picture in pixels.
        margin : float
            Height of the picture over the least height.

        Returns
        -------
        Camera
            Its centre is that of the bodies' extent.
        """
        axes = _axes(np.asarray(direction, float), np.asarray(up, float))
        seen = np.concatenate([body.surface.vertices for body in bodies]) @ axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        width, height, _ = high - low
        height = margin * max(height, width * size[1] / size[0])
        return Camera(0.5 * (low + high) @ axes, axes[2], axes[1], height)

    @property
    def axes(self) -> Array:
        """Rows right, up, forward (3, 3)."""
        return _axes(self.direction, self.up)

    def rays(self, size: tuple[int, int], distance: float) -> tuple[Array, Array]:
        """Origins (h w, 3) in rows from the top left, `distance` mm before the centre; direction (3,)."""
        right, up, forward = self.axes
        pixel = self.height / size[1]
        x = (np.arange(size[0]) - 0.5 * (size[0] - 1)) * pixel
        y = (0.5 * (size[1] - 1) - np.arange(size[1])) * pixel
        origins = self.centre - distance * forward + (y[:, None, None] * up + x[None, :, None] * right)
        return origins.reshape(-1, 3), forward


@dataclass(frozen=True)
class Cut:
    """Removes what lies on one side of a plane; closed surfaces are capped with their flat colour.

    Parameters
    ----------
    point : array (3,)
        Point in mm on the plane.
    normal : array (3,)
        Normal of the plane, which points to the removed side.
    """

    point: Array
    normal: Array


def render(
    bodies: Sequence[Drawable], camera: Camera, size: tuple[int, int] = (640, 480), cut: Cut | None = None
) -> Image:
    """Picture of bodies in RGBA.

    Of each transparent body only its foremost sheet is drawn; opaque bodies hide each other.

    Parameters
    ----------
    bodies : sequence of Drawable
        Bodies to be drawn, at least one.
    camera : Camera
        Projection.
    size : tuple of int
        Width and height in pixels.
    cut : Cut, optional
        Plane that removes one side.

    Returns
    -------
    array (height, width, 4)
        Colours and opacities in 0..255, transparent where the camera sees no surface.
    """
    fine = (size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING)
    corners = np.concatenate([body.surface.vertices for body in bodies])
    distance = 1.0 + float(np.linalg.norm(corners - camera.centre, axis=1).max())
    origins, forward = camera.rays(fine, distance)
    tracers = [_Tracer(body, camera.axes, capped=cut is not None) for body in bodies]
    colour = np.zeros((len(origins), 4), np.float32)  # premultiplied by its opacity
    for begin in range(0, len(origins), TILE):
        tile = slice(begin, begin + TILE)
        colour[tile] = _composite(tracers, origins[tile], forward, 2 * distance, cut)
    pixels = colour.reshape(size[1], SUPERSAMPLING, size[0], SUPERSAMPLING, 4).mean(axis=(1, 3))
    alpha = pixels[..., 3:]
    pixels[..., :3] = np.divide(pixels[..., :3], alpha, out=np.zeros_like(pixels[..., :3]), where=alpha > 0)
    return np.round(255 * np.clip(pixels, 0, 1)).astype(np.uint8)


def on_background(image: Image, rgb: tuple[float, float, float] = (1, 1, 1)) -> Image:
    """A picture laid over a plain colour.

    Parameters
    ----------
    image : array (h, w, 4)
        Picture of `render`.
    rgb : tuple of float
        Colour in 0..1.

    Returns
    -------
    array (h, w, 3)
        Colours in 0..255.
    """
    alpha = image[..., 3:] / 255.0
    return np.round(image[..., :3] * alpha + 255 * np.asarray(rgb) * (1 - alpha)).astype(np.uint8)


class _Tracer:
    """One body's Embree scene and what its shading needs."""

    def __init__(self, body: Drawable, axes: Array, capped: bool) -> None:
        self.vertices, self.triangles = body.surface.vertices, body.surface.triangles
        self.normals = body.surface.vertex_normals()
        self.rgb = np.broadcast_to(np.asarray(body.rgb, float), (len(self.vertices), 3))
        self.opacity = body.opacity
        self.capped = capped and body.surface.is_closed()
        right, up, forward = axes
        self.headlight = -forward
        self.sidelight = _unit(up - 0.6 * right - 0.4 * forward)
        self.scene = EmbreeScene()
        vertices, triangles = self.vertices.astype(np.float32), self.triangles.astype(np.int32)
        self.mesh = TriangleMesh(self.scene, vertices, triangles)

    def trace(
        self, origins: Array, forward: Array, begin: Array, end: Array
    ) -> tuple[IntArray, Array, Array]:
        """Rays (k,) that hit the body within [begin, end]: their indices, distances and colours (k, 3)."""
        starts = (origins + begin[:, None] * forward).astype(np.float32)
        hits = self.scene.run(starts, np.broadcast_to(forward, starts.shape).astype(np.float32), output=True)
        hit = np.flatnonzero((hits["primID"] >= 0) & (begin + hits["tfar"] <= end))
        corners = self.triangles[hits["primID"][hit]]
        u, v = hits["u"][hit], hits["v"][hit]
        weights = np.column_stack([1 - u - v, u, v])
        normal = _unit(np.einsum("ni,nij->nj", weights, self.normals[corners]))
        rgb = np.einsum("ni,nij->nj", weights, self.rgb[corners])
        inside = hits["Ng"][hit] @ forward > 0  # the ray meets the back of the sheet
        light = self._light(np.where(inside[:, None], -normal, normal))
        distance = hits["tfar"][hit].astype(float)
        if self.capped:  # a cut opened the body: draw its cap, where the ray starts
            light[inside], distance[inside] = AMBIENT + HEADLIGHT, 0.0
        return hit, begin[hit] + distance, np.minimum(rgb * light[:, None], 1.0)

    def _light(self, normal: Array) -> Array:
        front = HEADLIGHT * np.maximum(normal @ self.headlight, 0)
        return AMBIENT + front + SIDELIGHT * np.maximum(normal @ self.sidelight, 0)


def _composite(
    tracers: Sequence[_Tracer], origins: Array, forward: Array, reach: float, cut: Cut | None
) -> Array:
    """Premultiplied RGBA (n, 4): the nearest opaque sheet, and transparent ones over it from the back."""
    begin, end = _kept(origins, forward, reach, cut)
    nearest, out = np.full(len(origins), np.inf), np.zeros((len(origins), 4))
    veils = []
    for tracer in tracers:
        ray, depth, colour = tracer.trace(origins, forward, begin, end)
        if tracer.opacity < 1:
            veils.append((np.full(len(origins), np.inf), np.zeros((len(origins), 4))))
            veils[-1][0][ray] = depth
            veils[-1][1][ray] = tracer.opacity * np.column_stack([colour, np.ones(len(ray))])
            continue
        front = depth < nearest[ray]
        nearest[ray[front]] = depth[front]
        out[ray[front], :3], out[ray[front], 3] = colour[front], 1.0
    if veils:
        depths, colours = np.stack([d for d, _ in veils]), np.stack([c for _, c in veils])
        rays = np.arange(len(origins))
        for farthest in np.argsort(-depths, axis=0, kind="stable"):
            over = colours[farthest, rays] * (depths[farthest, rays] < nearest)[:, None]
            out = over + (1 - over[:, 3:]) * out
    return out


def _kept(origins: Array, forward: Array, reach: float, cut: Cut | None) -> tuple[Array, Array]:
    """The part [begin, end] in mm of each ray that a cut leaves."""
    begin, end = np.zeros(len(origins)), np.full(len(origins), reach)
    if cut is None:
        return begin, end
    normal = _unit(np.asarray(cut.normal, float))
    height, slope = (origins - cut.point) @ normal, float(forward @ normal)
    if slope < 0:
        begin = np.maximum(height / -slope, 0.0)
    elif slope > 0:
        end = np.minimum(-height / slope, reach)
    else:
        end[height > 0] = -1.0
    return begin, end


def _axes(direction: Array, up: Array) -> Array:
    forward = _unit(np.asarray(direction, float))
    right = _unit(np.cross(forward, np.asarray(up, float)))
    return np.stack([right, np.cross(right, forward), forward])


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
