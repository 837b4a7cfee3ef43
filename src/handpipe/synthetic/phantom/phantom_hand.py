"""The phantom hand: bones and joints of a whole hand with known truth in twelve poses, and a pose's files."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from handpipe.core.configuration import Dataset
from handpipe.synthetic.geometry.implicit import Implicit
from handpipe.synthetic.geometry.kinematics import Posture
from handpipe.synthetic.phantom import posed_hand
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.hand_tissue import Layout, Surroundings
from handpipe.synthetic.phantom.phantom_hand_bones import PlacedBone, Surface, bones, frames, rays, stretch
from handpipe.synthetic.phantom.phantom_hand_joints import BETWEEN, POSES, joints
from handpipe.synthetic.phantom.posed_hand import Hand, HandMotion

SURFACE_SPACING = 0.6  # mm of the grid that bones are contoured on


@cache
def hand(build: HandBuild | None = None) -> Hand:
    """The one phantom hand, or another one of the same plan at its size."""
    known = bones(build)

    def surfaces(part: Callable[[PlacedBone], Implicit]) -> dict[str, Surface]:
        found = {n: b.surface(part(b), SURFACE_SPACING) for n, b in known.items()}
        if build is None:
            return found
        return {n: (build.size * build.shaped(vertices), t) for n, (vertices, t) in found.items()}

    around = Surroundings.build(layout(build))
    return Hand(
        surfaces(lambda bone: bone.known.whole),
        surfaces(lambda bone: bone.known.marrow),
        around if build is None else around.scaled(build.size),
    )


def layout(build: HandBuild | None = None) -> Layout:
    """Where the bones lie; of another hand before it has its size."""
    chains = {
        ray: tuple((f"{kind}{ray}", s.length, s.girth) for kind, s in segments.items())
        for ray, segments in rays(build).items()
    }
    if build is None:
        return Layout(frames(), chains)
    return Layout(frames(build), chains, stretch(build), build.flesh)


def motion() -> HandMotion:
    """The joints and all poses."""
    return HandMotion("phantom-hand", joints(), POSES | BETWEEN)


def posture(pose: str, seed: int) -> Posture:
    """Posture of a named pose; the root is repositioned by up to 5 degrees and 6 mm in all but neutral."""
    return motion().posture(pose, seed)


def generate_pose(dataset: Dataset, pose: str) -> None:
    """Write a pose's volume, truth and label volumes where the dataset names them; `seeds.draw` adds seeds.

    Raises
    ------
    InputError
        For an unknown pose, and for parts that the phantom does not have.
    """
    posed_hand.require_bones_alone(dataset, hand().bones)
    posed_hand.write_pose(dataset, pose, hand().posed(posture(pose, dataset.seed)))


def generate_templates(dataset: Dataset) -> None:
    """Write the templates of bones that the dataset names: their own neutral surfaces.

    Raises
    ------
    InputError
        For templates of muscles and others that this phantom does not have.
    """
    posed_hand.require_bones_alone(dataset, hand().bones)
    posed_hand.write_templates(dataset, hand().posed(posture("neutral", dataset.seed)))
