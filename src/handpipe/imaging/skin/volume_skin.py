"""The skin in the volume of a pose, as a closed surface (Wang 2019, Sec. 5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage import measure

from handpipe.core import Array, BoolArray, InputError
from handpipe.imaging.skin.body_voxels import BodyInVolume, measured
from handpipe.imaging.skin.contacts import Contacts, PosedBones
from handpipe.imaging.skin.edge import refined
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.contact import crossings, cuts_itself
from handpipe.mesh.surfaces import Surface, averaging, component_labels, taubin

COARSEST = 4.0  # mm: a finger has fewer than four thicker slices
SMOOTHING = (0.0, 0.5, 0.8, 1.2)  # voxels; the first that leaves no handle
FIRST_SMOOTHING = 10  # rounds, of the voxels' steps
UNTANGLING = 12  # rounds
BEYOND = 2  # voxels beyond the border of the image
SURE = 0.25  # of a full weight
JUST_INSIDE, JUST_OUTSIDE = 1.01, 0.99  # of the threshold: bounds of voxels at the border


@dataclass(frozen=True)
class VolumeSkin:
    """The skin in a volume.

    Parameters
    ----------
    closed : Surface
        Closed surface that faces outwards, in world mm; flat where the border of the image cuts the limb.
    cut : array (k,) of bool
        Triangles of these flat ends.
    sure : float
        Share of the other vertices at which the image shows an edge that the neighbours' edges confirm.
    handles : int
        Genus of the surface: 0 unless parts of the body touch.
    others : int
        Other large parts in the image that are not in the surface.
    contact_faces : int
        Faces of voxels at which parts that touch were told apart.
    """

    closed: Surface
    cut: BoolArray
    sure: float
    handles: int
    others: int
    contact_faces: int

    @property
    def open(self) -> Surface:
        """As a scan shows it: without the flat ends."""
        return Surface(self.closed.vertices, self.closed.triangles[~self.cut]).compact()

    @property
    def ends(self) -> int:
        """Number of flat ends."""
        return 0 if not self.cut.any() else int(component_labels(self.closed.triangles[self.cut]).max()) + 1


def skin_of_volume(volume: Volume, bones: PosedBones | None = None) -> VolumeSkin:
    """The skin in a volume, below the voxel size.

    The body is what is brighter than the air around it and than a share of the tissue nearby, without holes.
    Along the normals of its surface the skin is where the intensity is half-way from the air's to that of the
    tissue at the edge, so that the coil's fall-off and the tissue under the skin do not move it.

    Parameters
    ----------
    volume : Volume
        Image of the pose, with air around the limb.
    bones : PosedBones, optional
        The pose's bones, by which parts that touch are told apart. Without them parts that touch stay joined.

    Returns
    -------
    VolumeSkin
        The skin in world mm.

    Raises
    ------
    InputError
        Where the image shows no body, no air, or slices that are too thick for a closed surface.
    ConvergenceError
        If the smooth displacement does not converge.
    """
    if volume.spacing.max() > COARSEST:
        problem = f"are {volume.spacing.max():.3g} mm apart: between them nothing tells where the skin is"
        raise InputError(
            "volume", "slices", problem, f"Give a scan of the skin, or slices of {COARSEST:g} mm"
        )
    volume = measured(volume)
    longer = _prolonged(volume)
    body = BodyInVolume.find(longer)
    contacts = Contacts.find(longer, body, bones) if bones else Contacts.none(longer)
    first, handles = _first_surface(longer, body, contacts.gap)
    beyond = _beyond(volume, first) > BEYOND
    surface, weights = refined(longer, first, body.air, ~beyond, contacts.places)
    surface = _untangled(surface, first)
    surface, cut = _ended(volume, surface)
    sure = float((weights[~beyond] > SURE).mean())
    return VolumeSkin(surface, cut, sure, handles, body.others, len(contacts.places))


def _first_surface(volume: Volume, body: BodyInVolume, gap: BoolArray) -> tuple[Surface, int]:
    """Surface of the body by the threshold nearby, and its genus."""
    inside = body.inside & ~gap
    edge = inside & ~ndimage.binary_erosion(inside, border_value=1)
    ratio = np.clip(volume.values / np.maximum(body.threshold, 1e-6 * volume.bright), 0.0, 2.0)
    ratio = np.where(
        inside, np.where(edge, np.maximum(ratio, JUST_INSIDE), 2.0), np.minimum(ratio, JUST_OUTSIDE)
    )
    ratio[gap] = 0.0
    for deviation in SMOOTHING:
        field = ndimage.gaussian_filter(ratio, deviation, mode="nearest") if deviation else ratio
        surface = _contour(volume, field)
        handles = genus(surface)
        if handles == 0:
            break
    return taubin(surface, FIRST_SMOOTHING), handles


def _contour(volume: Volume, field: np.ndarray) -> Surface:
    """The closed surface of what is above 1, its largest part; closed half a voxel beyond the border."""
    padded = np.pad(field, 1, constant_values=0.0)
    vertices, triangles, _, _ = measure.marching_cubes(padded, 1.0, gradient_direction="ascent")
    surface = Surface(volume.to_world(vertices - 1.0), triangles.astype(np.int64)).largest_component()
    return surface if surface.volume() > 0 else surface.flipped()


def genus(surface: Surface) -> int:
    """Number of handles of a closed surface of one part."""
    return 1 - (len(surface.vertices) - len(surface.edges()) + len(surface.triangles)) // 2


def _untangled(surface: Surface, first: Surface) -> Surface:
    """The surface, moved back towards the first one where it crosses itself, as at the end of a gap."""
    mean = averaging(surface)
    for _ in range(UNTANGLING):
        if not cuts_itself(surface):
            break
        pairs = crossings(surface)
        back = np.zeros(len(surface.vertices))
        back[surface.edges()[pairs[:, 0]]] = back[surface.triangles[pairs[:, 1]]] = 1.0
        back = np.minimum(back + mean @ back + mean @ (mean @ back), 1.0)[:, None]
        surface = surface.moved(surface.vertices + 0.5 * back * (first.vertices - surface.vertices))
    return surface


def _prolonged(volume: Volume) -> Volume:
    """The volume with its border repeated, so that the skin is found up to the border."""
    affine = volume.affine.copy()
    affine[:3, 3] = volume.to_world(np.full((1, 3), -float(BEYOND)))[0]
    return Volume(np.pad(volume.values, BEYOND, mode="edge"), affine)


def _beyond(volume: Volume, surface: Surface) -> Array:
    """How far (n,) vertices lie beyond the border of the image, in voxels."""
    index = volume.to_index(surface.vertices)
    return np.max(np.maximum(-index, index - (np.array(volume.shape) - 1.0)), axis=1)


def _ended(volume: Volume, surface: Surface) -> tuple[Surface, BoolArray]:
    """The surface with what lies beyond the border flattened on to it, and which triangles are flat ends."""
    ends = (_beyond(volume, surface) > 0.0)[surface.triangles].any(axis=1)
    index = volume.to_index(surface.vertices)
    seen = np.clip(index, 0.0, np.array(volume.shape) - 1.0)
    return surface.moved(volume.to_world(seen)), np.asarray(ends)
