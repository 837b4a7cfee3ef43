"""Confidence that a bone is where it was found: from the image's edges, its joints and its neighbours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import RigidTransform, artifacts
from handpipe.core.configuration import Segmentation
from handpipe.imaging.volumes import Volume
from handpipe.skeleton.localisation.edge_agreement import agreement
from handpipe.skeleton.localisation.joint_search import Departure, falling
from handpipe.skeleton.localisation.locating import HandModel

KIND = "located_bones"
USUAL = Segmentation().edges  # share of edges of a bone in a right place
SURE = 0.5  # below it a person has to look
MARGIN = 0.15  # from it, within which a verdict is uncertain
SEEN = (-0.5, -0.2)  # less the share inside the image: from where to where confidence falls
OVERLAP = (0.03, 0.15)  # share inside another bone: from where to where confidence falls
NONE = 0.625  # of the usual share of edges, at which there is no confidence


@dataclass(frozen=True)
class LocationConfidence:
    """Evidence for a bone's place.

    Parameters
    ----------
    edges : float
        Share of the marrow's surface that lies on an edge from bright to dark.
    seen : float
        Share of the marrow's surface inside the image.
    overlap : float
        Share of the marrow's surface inside another bone.
    carried : float
        Certainty in [0, 1] that the joints from the root to this bone leave: a bone that fits well to a
        misplaced one is misplaced.
    departure : Departure, optional
        From what the joint to its parent can do; None for bones of the root.
    usual : float
        Share of edges that leaves no doubt.
    """

    edges: float
    seen: float
    overlap: float
    carried: float
    departure: Departure | None = None
    usual: float = USUAL

    @property
    def value(self) -> float:
        """Confidence in [0, 1]: the product over the kinds of evidence."""
        inside = falling(-self.seen, *SEEN) * falling(self.overlap, *OVERLAP)
        return of_edges(self.edges, self.usual) * inside * self.carried

    @property
    def marked(self) -> bool:
        """Whether a person has to look."""
        return self.value < SURE

    @property
    def near(self) -> bool:
        """Whether the value lies so near the threshold that the verdict may be wrong."""
        return abs(self.value - SURE) < MARGIN

    @property
    def verdict(self) -> str:
        """What follows from the value, with its figure."""
        kind = "marked" if self.marked else "doubtful" if self.near else "sure"
        return f"{kind}, confidence {self.value:.2f}" + (f" near the limit of {SURE}" if self.near else "")


def of_edges(share: float, usual: float = USUAL) -> float:
    """Certainty in [0, 1] for a share of edges that agree; with the usual share, 1."""
    return falling(-share, -usual, -NONE * usual)


def confidences(
    model: HandModel, normalised: Volume, found: Mapping[str, RigidTransform]
) -> dict[str, LocationConfidence]:
    """Confidence in the place of every bone.

    Parameters
    ----------
    model : HandModel
        The neutral hand.
    normalised : Volume
        Image of the pose in units of the local marrow level.
    found : mapping of str to RigidTransform
        Transforms from neutral by bone, as `locate` gives them.

    Returns
    -------
    dict of str to LocationConfidence
        Confidence by bone.
    """
    motions = [found[body.bones[0]] for body in model.bodies]
    root = agreement(normalised, model.bodies[0].probes, motions[0])
    carried, departures = {0: of_edges(root.share, model.edges)}, {}
    for link in model.links:
        departure = link.departure(motions[link.parent], motions[link.child])
        carried[link.child] = carried[link.parent] * departure.plausible
        departures[link.child] = departure
    result = {}
    for number, body in enumerate(model.bodies):
        for bone in body.bones:
            agrees = agreement(normalised, model.probes[bone], found[bone])
            overlap = max(
                (model.overlap(bone, found[bone], o, t) for o, t in found.items() if o != bone), default=0.0
            )
            of_joints = carried[number], departures.get(number)
            result[bone] = LocationConfidence(agrees.share, agrees.seen, overlap, *of_joints, model.edges)
    return result


def write_located(
    path: str | Path,
    motions: Mapping[str, RigidTransform],
    sure: Mapping[str, LocationConfidence],
    inputs: Sequence[str | Path],
) -> None:
    """Write where bones were found, and the evidence for it, as an artifact.

    Parameters
    ----------
    path : str or Path
        File to write.
    motions : mapping of str to RigidTransform
        Transforms from neutral (mm) by bone.
    sure : mapping of str to LocationConfidence
        Confidence in each of these bones.
    inputs : sequence of str or Path
        Files that the places were computed from; the artifact records their hashes.
    """
    data = {}
    for bone, motion in motions.items():
        c = sure[bone]
        evidence = {"edges": c.edges, "seen": c.seen, "overlap": c.overlap, "carried": c.carried}
        joint = {} if c.departure is None else {"departure": vars(c.departure)}
        place = {"rotation": motion.rotation, "translation": motion.translation}
        data[bone] = {**place, **evidence, "confidence": c.value, **joint}
    units = {f"{bone}/translation": "mm" for bone in motions}
    for bone in (b for b, c in sure.items() if c.departure):
        of_parts = {"turn": "deg", "off": "deg", "beyond": "deg", "gap": "mm", "neutral_gap": "mm"}
        units |= {f"{bone}/departure/{part}": unit for part, unit in of_parts.items()}
    artifacts.write(path, data, kind=KIND, units=units, inputs=inputs)


def read_located(path: str | Path) -> tuple[dict[str, RigidTransform], dict[str, LocationConfidence]]:
    """Where bones were found, and the evidence for it.

    Parameters
    ----------
    path : str or Path
        Artifact that `write_located` wrote.

    Returns
    -------
    motions : dict of str to RigidTransform
        Transforms from neutral (mm) by bone.
    sure : dict of str to LocationConfidence
        Confidence by bone.

    Raises
    ------
    InputError
        As `artifacts.read` does.
    """
    motions, sure = {}, {}
    for bone, d in artifacts.read(path, KIND).items():
        motions[bone] = RigidTransform(d["rotation"], d["translation"])
        joint = {part: float(v) for part, v in d["departure"].items()} if "departure" in d else None
        edges, seen, overlap, carried = (float(d[p]) for p in ("edges", "seen", "overlap", "carried"))
        sure[bone] = LocationConfidence(edges, seen, overlap, carried, Departure(**joint) if joint else None)
    return motions, sure
