"""A wrist of real bone shapes in known poses, imaged to its ends: forearm, carpals, bases of metacarpals.

Z-Anatomy's right hand gives the shapes; the motions are made: the proximal row takes a share of the hand's
motion, and the distal row moves with the metacarpals. Tissue ends at the borders of the images, as in a scan.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.imaging.volumes import write_segments
from handpipe.mesh.generation import implicit as grids
from handpipe.mesh.generation import remesh
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.acquisition import image, sampled, seeds
from handpipe.synthetic.acquisition.posed import repositioning
from handpipe.synthetic.geometry.kinematics import KnownJoint, Posture, ramp
from handpipe.synthetic.real_anatomy import carving, real_hand, zanatomy_bones
from handpipe.synthetic.real_anatomy.source_meshes import read_mesh, repair_mesh, subdivided
from handpipe.synthetic.real_anatomy.zanatomy_source import HAND
from handpipe.synthetic.template_hands import real_skin

Surface = tuple[Array, IntArray]

SOURCE = Path(__file__).parents[3] / "shared" / "data"

FOREARM = {"radius": "Radius_r", "ulna": "Ulna_r"}
PROXIMAL = ("scaphoid", "lunate", "triquetrum", "pisiform")
DISTAL = ("trapezium", "trapezoid", "capitate", "hamate")
METACARPALS = tuple(f"metacarpal{ray}" for ray in range(1, 6))
WITH = {  # bones that move with another one
    "ulna": "radius",
    "triquetrum": "lunate",
    "pisiform": "lunate",
    **dict.fromkeys(("trapezium", "trapezoid", "hamate", *METACARPALS), "capitate"),
}
# deg about +y (to the palm) and +z (to radial) of scaphoid and lunate on the radius, capitate on the lunate
POSES: Mapping[str, tuple[float, ...]] = {
    "neutral": (0, 0, 0, 0, 0, 0),
    "flexed": (24, 0, 18, 0, 20, 0),
    "extended": (-24, 0, -18, 0, -16, 0),
    "deviated": (-8, -10, -11, -10, 11, -14),
    "between": (9, -5, 6, -5, 12, -7),  # held out
}
HELDOUT = ("between",)
SPAN = (-62.0, 38.0)  # mm along the hand: what there is of the limb
SEEN = (-48.0, 16.0)  # mm along the forearm: what an image shows of it
CORTEX, GAP = 0.9, 0.9  # mm
AIR = 6.0  # mm beside the limb
BANDS = {"radius_lunate": 14.0, "lunate_capitate": 14.0}  # mm to either side over which skin follows a joint
FLESH = real_skin.Closing(15.0, 6.5)
FAT = 3.0  # mm under the skin


@dataclass(frozen=True)
class Wrist:
    """Neutral bones and skin in the frame of `real_hand.hand_frame`, and the joints that move them.

    Parameters
    ----------
    folder : Path
        The source anatomy.
    names : tuple of str
        Bones that there are, the first two of the forearm; others are left out. Radius, scaphoid, lunate and
        capitate have to be among them.
    """

    folder: Path
    names: tuple[str, ...] = (*FOREARM, *PROXIMAL, *DISTAL, *METACARPALS)

    @cached_property
    def bones(self) -> dict[str, Surface]:
        """Closed bones, `GAP` apart in every pose."""
        files = {n: f"{n.capitalize()}_bone_r" for n in (*PROXIMAL, *DISTAL)} | FOREARM
        files |= {n: zanatomy_bones.FILES[n] for n in (*METACARPALS, "proximal3")}
        raw = {
            name: subdivided(repair_mesh(read_mesh(self.folder / HAND / f"{files[name]}.ply"), name))
            for name in {*self.names, "metacarpal2", "metacarpal3", "metacarpal5", "proximal3"}
        }
        place = real_hand.hand_frame({n: (mesh.vertices, mesh.triangles) for n, mesh in raw.items()})
        whole = {name: _clipped((place(raw[name].vertices), raw[name].triangles)) for name in self.names}
        pairs = [(a, b) for i, a in enumerate(self.names) for b in self.names[:i]]
        joints, still = _joints(whole), RigidTransform.identity()
        postures = [_WristPosture(joints, _angles(pose), still, names=self.names) for pose in POSES]
        return carving.kept_apart(whole, pairs, postures, GAP)

    @cached_property
    def marrow(self) -> dict[str, Surface]:
        """What is `CORTEX` deep in each bone."""
        found = {}
        for name, bone in self.bones.items():
            grid = grids.Grid.around(bone[0], 1.0, 0.5)
            depth = sampled.of_surface(bone, 0.5, 2.0)(grid.points())
            mesh = grids.isosurface(depth, grid, -CORTEX).largest_component().compact()
            found[name] = mesh.vertices, mesh.triangles
        return found

    @cached_property
    def joints(self) -> tuple[KnownJoint, ...]:
        """Of scaphoid and lunate on the radius, and of the capitate on the lunate."""
        return _joints(self.bones)

    @cached_property
    def skin(self) -> tuple[Surface, Surface]:
        """The closed neutral skin, and what lies under the fat."""
        points = np.concatenate([vertices for vertices, _ in self.bones.values()])
        grid = grids.Grid.around(points, FLESH.outwards + 3.0, real_skin.SPACING)
        filled = real_skin.occupied([Mesh(*bone) for bone in self.bones.values()], grid)
        outline = gaussian_filter(real_skin.closed(filled, FLESH), 3.0)
        surfaces = []
        for depth in (0.0, -FAT):
            mesh = remesh(grids.isosurface(outline, grid, depth).largest_component().compact(), 1.2)
            surfaces.append((mesh.vertices, mesh.triangles))
        return surfaces[0], surfaces[1]

    def posture(self, pose: str) -> Posture:
        """Of a pose, with the limb laid into the scanner anew."""
        root = RigidTransform.identity() if pose == "neutral" else repositioning(3, pose)
        return _WristPosture(self.joints, _angles(pose), root, names=self.names)

    def motions(self, pose: str) -> dict[str, RigidTransform]:
        """From neutral into the pose, by bone."""
        return self.posture(pose).transforms()

    def bent(self, pose: str, points: Array) -> Array:
        """Points (n, 3) of the neutral skin in a pose."""
        shares = {
            joint.name: ramp(joint.along(points), -BANDS[joint.name], BANDS[joint.name])
            for joint in self.joints
            if joint.name in BANDS
        }
        chain = tuple(joint for joint in self.joints if joint.name in BANDS)
        posture = self.posture(pose)
        return Posture(chain, posture.angles, posture.root).bend(points, shares)

    def write(self, folder: Path, poses: tuple[str, ...], spacing: float) -> None:
        """Volumes of poses, and a segmentation with strokes of neutral, as a person has them."""
        folder.mkdir(parents=True, exist_ok=True)
        for pose in poses:
            self._write(folder, pose, spacing)

    def _write(self, folder: Path, pose: str, spacing: float) -> None:
        random = np.random.default_rng(zlib.crc32(pose.encode()))
        grid, motions = self.grid(pose, spacing), self.motions(pose)
        clean = image.paint_layers(self._layers(pose, grid), image.INTENSITIES, grid)
        scanned = image.acquire(clean, grid, random, bias=0.1, noise=0.02)[0]
        image.write_volume(folder / f"{pose}.nii.gz", scanned.astype(np.float32), grid)
        if pose != "neutral":
            return
        whole, marrow = (
            seeds.majority(
                {
                    number: image.occupancy((motions[name](part[name][0]), part[name][1]), grid)
                    for number, name in enumerate(self.names, 1)
                }
            )
            for part in (self.bones, self.marrow)
        )
        strokes = seeds.scribble_locally(marrow, whole, grid, random)
        table = {name: number for number, name in enumerate(self.names, 1)} | {"background": 255}
        write_segments(folder / "neutral-seeds.seg.nrrd", strokes, grid.affine, table)

    def grid(self, pose: str, spacing: float) -> image.VoxelGrid:
        """The voxels of a pose: air beside the limb, none at its ends."""
        points = self.bent(pose, self.skin[0][0])
        points = points[(points[:, 0] > SEEN[0]) & (points[:, 0] < SEEN[1])]
        low, high = points.min(axis=0) - AIR, points.max(axis=0) + AIR
        low[0], high[0] = SEEN
        nx, ny, nz = (int(n) for n in np.ceil((high - low) / spacing) + 1)
        return image.VoxelGrid((nx, ny, nz), low, spacing)

    def _layers(self, pose: str, grid: image.VoxelGrid) -> Iterator[tuple[str, Array]]:
        motions = self.motions(pose)
        for tissue, (points, triangles) in zip(("fat", "muscle"), self.skin, strict=True):
            yield tissue, image.occupancy((self.bent(pose, points), triangles), grid)
        for tissue, part in (("cortical", self.bones), ("marrow", self.marrow)):
            posed = [(motions[name](points), triangles) for name, (points, triangles) in part.items()]
            shares = (share for bone in posed for share in image.local_occupancy(bone, grid))
            yield tissue, image.total_share(shares, grid.shape)

    @property
    def asked(self) -> list[str]:
        """The joints as `handpipe init --joint` takes them; pisiform on the triquetrum, for short chains."""
        balls = [("radius", "scaphoid"), ("radius", "lunate"), ("lunate", "capitate")]
        fixed = [
            ("triquetrum" if child == "pisiform" else parent, f"{child}:fixed")
            for child, parent in WITH.items()
        ]
        both = [(a, b) for a, b in balls + fixed if {a, b.removesuffix(":fixed")} <= {*self.names}]
        return [word for a, b in both for word in ("--joint", f"{a}-{b}")]


@dataclass(frozen=True)
class _WristPosture(Posture):
    """A posture of named bones, with those that move with others."""

    names: tuple[str, ...] = ()

    def transforms(self) -> dict[str, RigidTransform]:
        moved = super().transforms()
        return {name: moved[WITH.get(name, name)] for name in self.names}


def _clipped(bone: Surface) -> Surface:
    """A bone within `SPAN`."""
    points = bone[0][(bone[0][:, 0] > SPAN[0] - 2) & (bone[0][:, 0] < SPAN[1] + 2)]
    grid = grids.Grid.around(points, 2.0, 0.5)
    values = image.signed_distance(bone, image.VoxelGrid(grid.shape, grid.origin, grid.spacing), 2.0)
    x = grid.points()[:, 0].reshape(grid.shape)
    values = np.maximum(values, np.maximum(SPAN[0] - x, x - SPAN[1]))
    mesh = grids.isosurface(values, grid).largest_component().compact()
    return mesh.vertices, mesh.triangles


def _joints(bones: Mapping[str, Surface]) -> tuple[KnownJoint, ...]:
    capitate = bones["capitate"][0]
    head = capitate[np.argmin(capitate[:, 0])] + [4.0, 0.0, 0.0]
    middle = bones["lunate"][0].mean(axis=0)
    axes = np.eye(3)[1:]

    def joint(parent: str, child: str, centre: Array) -> KnownJoint:
        angles = (f"{child}_flexion", f"{child}_deviation")
        return KnownJoint(f"{parent}_{child}", parent, child, angles, axes, centre, np.zeros(3), np.zeros(3))

    return (
        joint("radius", "scaphoid", middle + [0.0, 4.0, 0.0]),
        joint("radius", "lunate", middle),
        joint("lunate", "capitate", head),
    )


def _angles(pose: str) -> dict[str, float]:
    kinds = ("flexion", "deviation")
    names = [f"{bone}_{kind}" for bone in ("scaphoid", "lunate", "capitate") for kind in kinds]
    return dict(zip(names, np.radians(POSES[pose]), strict=True))
