"""A knee's skin simulated from straight to bent: one tissue on the bones, against the image's skin."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.scans.knee_build import BENT, STRAIGHT, Knee
from handpipe.core import Array, BoolArray, Layer
from handpipe.evaluation import surface_distance
from handpipe.hand import simulate_frame
from handpipe.mesh.files import read_surface
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.bones import write_registrations
from handpipe.skeleton.posing import BoneLayer
from handpipe.skeleton.registration import unmoved
from handpipe.skeleton.rig import Rig
from handpipe.stages.poses import scanned_frame
from handpipe.stages.skeleton import fit_rig
from handpipe.stages.tissues import extract_skin, make_skin, mesh_soft_tissue
from handpipe.tissues.fat import Skin, load_skin

SKIN_EDGE, TISSUE_EDGE = 1.5, 2.5  # mm of the build
BESIDE_CUT = 2.5  # mm of the build from the ends of the straight limb: what lies beyond it is not simulated


@dataclass(frozen=True)
class BentSkin:
    """The bent knee's skin in its image, and simulated from the straight one; frame of the straight femur.

    Parameters
    ----------
    seen : Surface
        Skin in the bent image.
    simulated, unbent : Surface
        Simulated skin, and that of the straight knee of which it is made.
    errors, before : array (n,)
        Distance in mm of the build from points of the seen skin to the simulated one, and to the unbent one.
    compared : array (m,) of bool
        Points of the seen skin that lie beside the simulated limb, not beyond its ends.
    rig : Rig
        The knee's rig.
    """

    seen: Surface
    simulated: Surface
    unbent: Surface
    errors: Array
    before: Array
    compared: BoolArray
    rig: Rig


def rig_of(knee: Knee) -> Rig:
    """The rig from the one motion."""
    folder = knee.folder / "registration"
    folder.mkdir(parents=True, exist_ok=True)
    files = {pose: folder / f"{pose}.h5" for pose in (STRAIGHT, BENT)}
    write_registrations(files[STRAIGHT], unmoved(knee.surfaces(STRAIGHT)), [])
    write_registrations(files[BENT], knee.registered(STRAIGHT, BENT), [])
    neutral = knee.folder / "segmentation" / STRAIGHT / "surfaces.h5"
    written = (knee.folder / name for name in ("rig.h5", "rig-figures.json", "rig-table.json", "limits.json"))
    outputs = fit_rig.Outputs(*written)
    fit_rig.fit_rig(fit_rig.Inputs(neutral, list(files.values()), []), outputs, knee.dataset, organs=False)
    return Rig.load(outputs.rig)


def bent_skin(knee: Knee) -> BentSkin:
    """Skins of both images, one tissue between the bones and the straight one, and its shape when bent."""
    rig, skins = rig_of(knee), {pose: _skin(knee, pose) for pose in (STRAIGHT, BENT)}
    skin, mesh = knee.folder / "skin.h5", knee.folder / "soft_tissue.h5"
    make_skin.make_skin(make_skin.Inputs(skins[STRAIGHT], ()), skin, knee.dataset, SKIN_EDGE)
    mesh_soft_tissue.mesh_soft_tissue(
        mesh_soft_tissue.Inputs(knee.folder / "rig.h5", skin), mesh, knee.dataset, TISSUE_EDGE
    )
    layers: list[Layer] = [BoneLayer(rig.surfaces), load_skin([mesh], rig.surfaces)]
    shapes = simulate_frame(scanned_frame(rig, BENT), layers)["skin"]
    unbent = Skin.load(skin).with_ends(rig.surfaces)
    simulated = Surface(shapes["skin"].vertices, shapes["skin"].cells)
    scan = read_surface(skins[BENT]).largest_component()
    seen = scan.moved(rig.poses[BENT].root.inverse()(scan.vertices))
    ends = np.concatenate([part.vertices for part in unbent.rigid.values()])
    compared = surface_distance(seen.vertices, _patch(simulated, ends)) > BESIDE_CUT
    compared &= _beside(seen.vertices, simulated, ends)
    points = seen.vertices[compared]
    errors, before = (surface_distance(points, s) for s in (simulated, unbent.surface))
    return BentSkin(seen, simulated, unbent.surface, errors, before, compared, rig)


def _skin(knee: Knee, pose: str) -> Path:
    """The skin of a pose from its image."""
    path = knee.folder / "segmentation" / pose / "skin.ply"
    neutral = None if pose == STRAIGHT else knee.folder / "segmentation" / STRAIGHT / "skin.ply"
    image = knee.dataset.path(knee.dataset.poses[pose].volume)
    inputs = extract_skin.Inputs(image, knee.folder / "rig.h5", neutral)
    extract_skin.extract_skin(
        inputs, extract_skin.Outputs(path, path.with_suffix(".json")), knee.dataset, pose
    )
    return path


def _patch(surface: Surface, vertices: Array) -> Surface:
    """The part of a surface that some of its vertices span."""
    inside = np.isin(surface.triangles, vertices).all(axis=1)
    return Surface(surface.vertices, surface.triangles[inside]).compact()


def _beside(points: Array, surface: Surface, ends: Array) -> BoolArray:
    """Points (n,) whose closest triangle does not touch the limb's ends."""
    _, triangle, _ = Distance(surface).closest(points)
    return np.asarray(~np.isin(surface.triangles[triangle], ends).any(axis=1))
