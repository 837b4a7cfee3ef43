"""Manufactured joint motions and bone shapes with known truth."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


def turn(vector):
    return Rotation.from_rotvec(vector).as_matrix()


def motion(axes, centre, angles, rotation=None, translation=None):
    """Eq. 2 of Wang 2019 written out with scipy's rotations alone."""
    joint = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        joint = joint @ turn(np.asarray(axis) * angle)
    joint = (np.eye(3) if rotation is None else turn(rotation)) @ joint
    shift = np.zeros(3) if translation is None else translation
    return RigidTransform(joint, centre - joint @ centre + shift)


def noisy(transform, rng, degrees, mm, at=None):
    """The transform followed by a rotation about a point's image and a translation, of normal noise."""
    about = np.zeros(3) if at is None else transform(at)
    jitter = RigidTransform.about(about, turn(np.radians(degrees) * rng.normal(size=3)))
    return RigidTransform(np.eye(3), mm * rng.normal(size=3)) @ jitter @ transform


def off_by(rng, degrees, axes):
    """Unit axes (k, 3), each tilted by so many degrees in a random direction, as a person's hints are."""
    tilts = [unit(np.cross(a, rng.normal(size=3))) for a in axes]
    return np.array([turn(np.radians(degrees) * t) @ unit(a) for a, t in zip(axes, tilts, strict=True)])


def bone(count=40, around=36, stretch=1.0, seed=None):
    """A closed bone-like surface: a shaft along x, a base and two unlike condyles; meshed by rings.

    The shape does not depend on `count`, `around` or `stretch` (where rings lie), only its mesh does.
    """
    s = np.linspace(0, np.pi, count + 2)[1:-1]
    s = s + 0.15 * (stretch - 1) * np.sin(2 * s)
    t = np.linspace(0, 2 * np.pi, around, endpoint=False)
    grid_s, grid_t = (g.ravel() for g in np.meshgrid(s, t, indexing="ij"))
    if seed is not None:
        jitter = np.random.default_rng(seed)
        grid_s = grid_s + jitter.uniform(-0.3, 0.3, len(grid_s)) * np.pi / (count + 1)
        grid_t = grid_t + jitter.uniform(-0.3, 0.3, len(grid_t)) * 2 * np.pi / around
    points = np.vstack([shape(0.0, 0.0), shape(grid_s, grid_t), shape(np.pi, 0.0)])
    ring = np.arange(count * around).reshape(count, around) + 1
    a, b = ring[:-1], ring[1:]
    a1, b1 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    last = len(points) - 1
    triangles = [np.stack([a, a1, b1], -1), np.stack([a, b1, b], -1)]
    first_cap = np.stack([np.zeros(around, int), np.roll(ring[0], -1), ring[0]], -1)
    last_cap = np.stack([np.full(around, last), ring[-1], np.roll(ring[-1], -1)], -1)
    faces = np.concatenate([x.reshape(-1, 3) for x in (*triangles, first_cap, last_cap)])
    surface = Surface(points, faces)
    return surface if surface.volume() > 0 else surface.flipped()


def shape(s, t):
    """Points of the bone at polar angle s from its far end and angle t about its axis, in mm."""
    x = 18 * np.cos(s)
    radius = (4.2 + 1.2 * (x / 18) ** 2) * np.sin(s) ** 0.6
    head = np.exp(-(((x - 13) / 5) ** 2))
    base = np.exp(-(((x + 13) / 5) ** 2))
    radius = radius * (
        1 + 0.10 * head * np.cos(2 * t) + 0.06 * head * np.sin(3 * t) + 0.05 * base * np.cos(t - 0.6)
    )
    return np.column_stack(np.broadcast_arrays(x, radius * np.cos(t), 0.85 * radius * np.sin(t)))
