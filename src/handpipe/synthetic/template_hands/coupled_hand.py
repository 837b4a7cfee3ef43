"""A hand with all soft tissue: poses of the coupled body, and the files of a dataset."""

from __future__ import annotations

import logging
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from handpipe.anatomy.person import SubjectTemplate
from handpipe.anatomy.templates import TissueMesh
from handpipe.core import Array, ConvergenceError, InputError, IntArray, Metrics, RigidTransform, artifacts
from handpipe.core.configuration import Dataset, Scanner
from handpipe.fem.solver import Options, solve
from handpipe.mesh.contact import crossings
from handpipe.mesh.surfaces import Distance, Surface, concatenate
from handpipe.synthetic.acquisition import image, scans
from handpipe.synthetic.acquisition.imaged import imaged
from handpipe.synthetic.acquisition.posed import PosedAnatomy, anatomy_of, write_surface, write_truth
from handpipe.synthetic.continuum.surfaces import outer_faces
from handpipe.synthetic.coupled import anatomy_file
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody, CoupledPose
from handpipe.synthetic.coupled.element_repair import repair_elements
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.pressure import with_volumes_kept
from handpipe.synthetic.coupled.submodel import refinement_error
from handpipe.synthetic.coupled.uninverted import uninverted
from handpipe.synthetic.coupled.validation import difference
from handpipe.synthetic.geometry import generic_hand
from handpipe.synthetic.geometry.kinematics import Posture
from handpipe.synthetic.geometry.tubes import sweep
from handpipe.synthetic.geometry.varied_shapes import BONES, ORGANS, Variation
from handpipe.synthetic.phantom.phantom_hand_bones import FINGERS, WITH_ROOT
from handpipe.synthetic.phantom.posed_hand import (
    MIRROR,
    HandMotion,
    mirrored_joint,
    mirrored_surface,
    mirrored_transform,
    volume_grid,
)
from handpipe.synthetic.real_anatomy import real_hand
from handpipe.synthetic.template_hands.hand_body import HandBody, materials, open_hand
from handpipe.synthetic.template_hands.known_hands import KnownHand, known_hand

log = logging.getLogger(__name__)

KIND = "coupled-pose"
REST = "neutral"  # the pose whose angles are zero
PARTS = (0.25, 0.5, 0.75, 1.0)  # of every pose: positions that bones are known to pass
STEP = 6.0  # deg of the joint that turns most: with twice as much, tissue starts inverted
PATIENCE = 300  # iterations: a clenched fist converges crease by crease
SHORT = 1.0  # mm that a node of quadratic tets moves at most in an iteration
# mm, and shares of the forces: solves of whole poses.
AT_REST = Options(displacement_tolerance=1e-3, force_tolerance=1e-4, max_iterations=PATIENCE, untangle=False)
CLICKS = 10  # points of a tendon that a person clicks
RAYS = {"thumb": real_hand.RAYS[1], **{f"finger{i}": real_hand.RAYS[i][1:] for i in FINGERS}}
WRIST = -22.0  # mm along the hand: scans end there
TEMPLATE_WARP = generic_hand.Distortion(
    np.array([60.0, 15.0, -18.0]),
    scale=1.05,
    bend=(0.0003, -0.0002),
    twist=0.0006,
    frame=RigidTransform(
        Rotation.from_euler("xyz", [4.0, -3.0, 5.0], degrees=True).as_matrix(), np.array([8.0, -5.0, 4.0])
    ),
)


def opened_hand(template: str | Path, subject: str | Path, known: KnownHand) -> CoupledAnatomy:
    """The template hand's anatomy as a coupled body, for all poses of its motion.

    Raises
    ------
    InputError
        If a joint opens through the skin.
    """
    motion = known.motion
    positions = [bones_at(motion, pose, share) for pose in motion.poses for share in PARTS]
    anatomy = open_hand(TissueMesh.load(template), SubjectTemplate.load(subject), positions, known.size)
    require_closed_skin(anatomy, template)
    return anatomy


def require_closed_skin(anatomy: CoupledAnatomy, source: str | Path) -> None:
    """Raise `InputError` where the outer surface has a rim: there a joint's cavity leads outside."""
    outer = Surface(anatomy.mesh.vertices, outer_faces(anatomy.mesh, anatomy.bones.values()))
    rim = outer.boundary_edges()
    if len(rim):
        place = ", ".join(f"{c:.1f}" for c in outer.vertices[rim[0, 0]])
        problem = f"is open along {len(rim)} edges where joints open, first at ({place})"
        raise InputError(source, "skin", problem, "Make tets between that joint and the skin smaller")


def hand_body(anatomy: str | Path, subject: str | Path, order: int) -> HandBody:
    """The coupled body of a hand's artifacts, with linear or quadratic tets (order 1 or 2)."""
    return HandBody.mesh(anatomy_file.load(anatomy), SubjectTemplate.load(subject), order)


def bones_at(
    motion: HandMotion, pose: str, share: float = 1.0, start: str = REST
) -> dict[str, RigidTransform]:
    """Where bones are at a share of the way from the pose `start` to another, with the root at rest."""
    before, after = motion.poses[start], motion.poses[pose]
    degrees = {name: share * to + (1 - share) * before[name] for name, to in after.items()}
    angles = {name: float(np.radians(value)) for name, value in degrees.items()}
    return Posture(motion.joints, angles, RigidTransform.identity(), WITH_ROOT).transforms()


def settle(hand: HandBody, motion: HandMotion, pose: str, start: str = REST, x: Array | None = None) -> Array:
    """Equilibrium positions (n, 3) of a pose, followed from the pose `start` at x (n, 3), or from rest.

    Quadratic tets begin at the equilibrium of linear ones.

    Raises
    ------
    ConvergenceError
        If there is no equilibrium.
    """
    if hand.quadratic:
        return _refined(hand, motion, pose, start, x)
    steps = max(int(np.ceil(_widest(motion, pose, start) / STEP)), 2)
    options = replace(AT_REST, name=pose)

    def at(t: float) -> CoupledPose:
        return hand.pose(bones_at(motion, pose, t, start))

    found = follow(hand.body, at, x, steps=steps, options=options)
    return with_volumes_kept(hand.body, at(1.0), found.x, options).x


def _refined(hand: HandBody, motion: HandMotion, pose: str, start: str, x: Array | None) -> Array:
    """Positions (n, 3) of the nodes of quadratic tets, from those of the same hand's linear ones.

    Some 345,000 nodes: linear systems are solved by two levels, of which the linear tets' is factorised. Bent
    skin that stays smooth with linear tets wrinkles on the way, so that steps are short. From another pose
    linear tets take the same way, and the quadratic tets' difference there is added where it inverts no tet.
    (Linear tets between the corners of quadratic ones may be inverted: they cannot continue from there.)
    """
    body, linear = hand.body, hand.linear()
    carry = body.elements.prolongation()
    before = None if x is None else settle(linear, motion, start)
    options = replace(AT_REST, name=f"{pose}, quadratic", coarse=carry, max_step=SHORT)
    at = hand.pose(bones_at(motion, pose))
    right = body.prescribed(at, carry @ settle(linear, motion, pose, start, before))
    begun = right if x is None else _other_start(body, body.prescribed(at, right + x - carry @ before), right)
    energies = body.energies(at)
    found = solve(energies, begun, fixed=body.fixed, options=options)
    # Keeping volumes also removes inversions where it changes shapes: first, since removing them takes as
    # long as all the rest. Linear tets, from which quadratic ones begin, end without inversion.
    kept = with_volumes_kept(body, at, found.x, options, right)
    return uninverted(body, energies, kept, options, right).x


def _other_start(body: CoupledBody, x: Array, right: Array) -> Array:
    """Positions x (n, 3), repaired by `right` where x is inverted; `ConvergenceError` where that fails."""
    if body.inverted(x) == 0:
        return x
    found = repair_elements(body, x, right)
    if found is None:
        problem = "what quadratic tets differ by in the other pose is inside out in this one"
        raise ConvergenceError("the other start", problem, "Begin from a pose nearer to it.")
    return found[0]


def _widest(motion: HandMotion, pose: str, start: str = REST) -> float:
    """Degrees by which the joint turns that turns most."""
    return max(abs(to - motion.poses[start][name]) for name, to in motion.poses[pose].items())


def start_difference(
    hand: HandBody, motion: HandMotion, found: Mapping[str, Array]
) -> tuple[str, str, float]:
    """How far in mm a pose's nodes end from where they are known to be, when reached from another pose.

    `found` has the positions (n, 3) of poses. Of these, the two that bend least are taken: from the first to
    the second. Returns their names, too.
    """
    one, other = _least_bent(motion, found)[:2]
    again = settle(hand, motion, other, one, found[one])
    return one, other, float(np.linalg.norm(again - found[other], axis=1).max())


def _least_bent(motion: HandMotion, poses: Iterable[str]) -> list[str]:
    """Poses other than rest, by how far their joints turn."""
    turned = {name: _widest(motion, name) for name in poses}
    return sorted((name for name in turned if turned[name] > 0), key=lambda name: turned[name])


def refinement_errors(
    hand: HandBody, motion: HandMotion, found: Mapping[str, Array]
) -> tuple[str, dict[str, Metrics]]:
    """How far linear tets are from quadratic ones in the pose that bends least.

    For a hand of quadratic tets as a whole; for one of linear tets ray by ray, each cut out: a finger,
    or the thumb with its metacarpal and the muscles there. Returns the pose's name, too.
    """
    [pose, *_], anatomy = _least_bent(motion, found), hand.body.anatomy
    if hand.quadratic:
        linear = hand.linear()
        return pose, {"hand": difference(linear.body, settle(linear, motion, pose), hand.body, found[pose])}
    bones = hand.subject.bones
    owner = np.repeat(np.arange(len(bones)), [len(b.vertices) for b in bones.values()])
    tree = cKDTree(np.concatenate([b.vertices for b in bones.values()]))
    nearest = owner[tree.query(anatomy.mesh.vertices[anatomy.mesh.tets].mean(axis=1))[1]]
    options, errors = Options(name=pose, displacement_tolerance=1e-3, untangle=False), {}
    x = found[pose]
    where = hand.pose(bones_at(motion, pose))
    for ray, names in RAYS.items():
        chosen = np.isin(nearest, [list(bones).index(name) for name in names])
        errors[ray] = refinement_error(anatomy, materials(anatomy), chosen, where, x, options)
    return pose, errors


def cuts_itself(body: CoupledBody, x: Array) -> bool:
    """Whether the skin passes through itself at positions x (n, 3)."""
    surface = Surface(x, body.skin_faces).compact()
    return len(crossings(surface)) > 0


def save(path: str | Path, x: Array, inputs: Sequence[str | Path]) -> None:
    """Write a pose's positions (n, 3) in mm (kind "coupled-pose")."""
    artifacts.write(path, {"positions": x}, kind=KIND, units={"positions": "mm"}, inputs=inputs)


def load(path: str | Path) -> Array:
    """The positions (n, 3) of a pose."""
    return np.asarray(artifacts.read(path, KIND)["positions"])


def posed(hand: HandBody, source: KnownHand, pose: str, x: Array, seed: int) -> PosedAnatomy:
    """All organs in a pose of a dataset, whose root is repositioned."""
    body, posture = hand.body, source.motion.posture(pose, seed)
    known, x = source.hand().posed(posture), posture.root(x)

    def organs(names: Mapping[str, object]) -> dict[str, tuple[Array, IntArray]]:
        found = {name: body.surface(name, x) for name in names}
        return {name: (s.vertices, s.triangles) for name, s in found.items()}

    lines = {name: body.strand_points(name) @ x for name in body.strands}
    radii = {name: tendon.radius for name, tendon in hand.subject.tendons.items()}
    skin = Surface(x, body.skin_faces).compact()
    return PosedAnatomy(
        posture,
        known.transforms,
        known.bones,
        known.marrow,
        organs(hand.subject.muscles),
        organs(hand.subject.ligaments),
        lines,
        {name: sweep(line, radii[name]) for name, line in lines.items()},
        radii,
        (skin.vertices, skin.triangles),
        {bone: (nail, known.transforms[bone]) for bone, nail in skin_over_nails(hand).items()},
    )


def mirrored(hand: PosedAnatomy) -> PosedAnatomy:
    """The same pose of the other hand, with the same angles."""

    def surfaces(given: Mapping[str, tuple[Array, IntArray]]) -> dict[str, tuple[Array, IntArray]]:
        return {name: mirrored_surface(surface) for name, surface in given.items()}

    old = hand.posture
    joints, root = tuple(map(mirrored_joint, old.joints)), mirrored_transform(old.root)
    return replace(
        hand,
        posture=replace(old, joints=joints, root=root),
        transforms={name: mirrored_transform(t) for name, t in hand.transforms.items()},
        bones=surfaces(hand.bones),
        marrow=surfaces(hand.marrow),
        muscles=surfaces(hand.muscles),
        ligaments=surfaces(hand.ligaments),
        tendons={name: line * MIRROR for name, line in hand.tendons.items()},
        tendon_tubes=surfaces(hand.tendon_tubes),
        skin=mirrored_surface(hand.skin),
        nails={bone: (ids, mirrored_transform(t)) for bone, (ids, t) in hand.nails.items()},
    )


def skin_over_nails(hand: HandBody) -> dict[str, IntArray]:
    """The triangles of the outer skin over each nail of the template, by the nail's bone."""
    outer = Surface(hand.body.rest, hand.body.skin_faces)
    skin = hand.subject.skin
    assert skin is not None
    below = skin.vertices[skin.triangles].mean(axis=1)
    nearest = cKDTree(below).query(outer.vertices[outer.triangles].mean(axis=1))[1]
    return {bone: np.flatnonzero(np.isin(nearest, ids)) for bone, ids in hand.subject.nails.items()}


def write_pose(dataset: Dataset, pose: str, hand: HandBody, x: Array) -> None:
    """Write a pose's volume, scan, truth and label volumes where the dataset names them."""
    source, files = known_hand(dataset), dataset.poses[pose]
    found = posed(hand, source, pose, x, dataset.seed)
    found = mirrored(found) if dataset.hand == "left" else found
    scanner, folder = dataset.scanner or Scanner(), dataset.truth
    grid = volume_grid(found.bones, found.bones, scanner.spacing)
    log.info("%s: %d x %d x %d voxels of %g mm", pose, *grid.shape, grid.spacing)
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 5])
    scanned = imaged(dataset, pose, anatomy_of(found, grid), grid, rng, scanner=scanner)
    image.write_volume(dataset.path(files.volume), scanned.astype(np.float32), grid)
    if files.scan is not None:
        rest = Surface(hand.body.rest, hand.body.skin_faces).compact().vertices
        write_surface(
            dataset.path(files.scan), *scans.scan(rest, *found.skin, rng, open_before=source.size * WRIST)
        )
    if folder is not None:
        labels = {name: bone.label for name, bone in dataset.bones.items()}
        for kind, surfaces in (("bones", found.bones), ("marrow", found.marrow)):
            volume = image.label_volume({label: surfaces[n] for n, label in labels.items()}, grid)
            image.write_volume(dataset.path(folder.folder) / f"{pose}.{kind}.nii.gz", volume, grid)
        nails = {name: found.nails[nail.bone] for name, nail in dataset.nails.items()}
        write_truth(dataset.path(folder.folder) / f"{pose}.h5", replace(found, nails=nails))


def write_templates(
    dataset: Dataset, hand: HandBody, neutral: Array, marked: Mapping[str, Mapping[str, IntArray]]
) -> None:
    """Write what a person brings: templates of another hand's shape, attachments, tendons' curves, nails.

    The other hand is this one warped, each bone with a shape of its own, and what is between bones with
    another one (`varied_shapes.py`). marked: vertices of each muscle's and ligament's surface by bone
    (`marked_ends.py`).
    """
    left = dataset.hand == "left"

    def write(path: Path, surface: Surface, points: Array) -> None:
        shape = TEMPLATE_WARP(points), surface.triangles
        write_surface(dataset.path(path), *(mirrored_surface(shape) if left else shape))

    subject, rng = hand.subject, np.random.default_rng([dataset.seed, 3])
    for name, bone in dataset.bones.items():
        if bone.template is not None:
            surface, own = subject.bones[name], Variation(dataset.seed, name, BONES)
            write(bone.template, surface, own(surface.vertices))
    varied = Variation(dataset.seed, "organs", ORGANS, Distance(concatenate([*subject.bones.values()])))
    for name, entry in {**dataset.muscles, **dataset.ligaments}.items():
        surface = {**subject.muscles, **subject.ligaments}[name].surface
        write(entry.template, surface, varied(surface.vertices))
        attachments = {bone: ids.tolist() for bone, ids in marked[name].items()}
        generic_hand.write_attachments(dataset.path(entry.attachments), attachments)
    found = posed(hand, known_hand(dataset), dataset.neutral, neutral, dataset.seed)
    found = mirrored(found) if left else found
    for name, tendon in dataset.tendons.items():
        line = found.tendons[name]
        clicked = line[np.linspace(0, len(line) - 1, CLICKS).astype(int)]
        noisy = clicked + 0.3 * rng.standard_normal(clicked.shape)
        generic_hand.write_curve(dataset.path(tendon.path), noisy, name)
    for nail in dataset.nails.values():
        vertices, triangles = found.skin
        patch = Surface(vertices, triangles[found.nails[nail.bone][0]]).compact()
        write_surface(dataset.path(nail.surface), patch.vertices, patch.triangles)
