"""A built limb as the hard cases see it: layers by name, and what moves them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from handpipe.core import LAYERS, Frame, Layer, RigidTransform, Shapes, artifacts_of
from handpipe.core.configuration import load_dataset, load_scene
from handpipe.hand import layer_loading, simulate_frame
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.angles import Angles, Limits
from handpipe.skeleton.posing import PoseValidity
from handpipe.skeleton.rig import Rig
from handpipe.stages.truth import surfaces_in, true_pose

ROOT = Path(__file__).parents[2]
SUBJECT, SCENE = "phantom-finger", "flexion"
PLAIN = 0.45  # share of all limits of flexion in the plain frame
TRUE_POSES = ("fist", "half")  # an example of the fits, and a pose held out from them


@dataclass(frozen=True)
class Subject:
    """A built limb.

    files: artifacts by layer, inside out; bones: neutral surfaces; limits in rad; transforms: of bones, from
    angles; collides: whether bones of a pose intersect; scanned: angles by pose; skins: true ones by pose.
    """

    files: Mapping[str, list[Path]]
    bones: Mapping[str, Surface]
    limits: Limits
    transforms: Callable[[Mapping[str, float]], Mapping[str, RigidTransform]]
    collides: Callable[[Angles], bool] = lambda _: False
    scanned: Mapping[str, Angles] = field(default_factory=lambda: MappingProxyType({}))
    skins: Mapping[str, Surface] = field(default_factory=lambda: MappingProxyType({}))

    @cached_property
    def layers(self) -> dict[str, Layer]:
        """All layers by name."""
        return {name: self.load(name) for name in self.files}

    def load(self, name: str, files: Iterable[Path] | None = None) -> Layer:
        """One layer, from its own artifacts or from others in their place."""
        return layer_loading.load_layer(name, list(files or self.files[name]), self.bones)

    def whole(self, **changed: Layer) -> list[Layer]:
        """The layers of a whole frame, some of them changed; one soft tissue only where that is asked for."""
        return [changed.get(name, layer) for name, layer in self.layers.items() if name != "skin"]

    def bent(self, flexion: float, sideways: float = 0.0, **own: float) -> Angles:
        """A pose in rad: each flexion at a share of its upper limit, or of its lower one where negative.

        sideways: the same of all other angles; own: shares of single angles.
        """

        def angle(name: str) -> float:
            share = own.get(name, flexion if name.endswith("flexion") else sideways)
            lower, upper = self.limits[name]
            return share * upper if share >= 0 else -share * lower

        return {name: angle(name) for name in self.limits}

    def frame(self, name: str, angles: Mapping[str, float]) -> Frame:
        """A frame at angles in rad, which may be wrong ones."""
        return Frame(name, dict(angles), self.transforms(angles))

    @cached_property
    def plain(self) -> Frame:
        """A frame well within what was scanned."""
        return self.frame("plain", self.bent(PLAIN))

    @cached_property
    def plain_shapes(self) -> dict[str, Shapes]:
        """What the plain frame is like as it is built; the aid of other layers is in it."""
        return simulated(self.plain, self.whole())

    def random(self, seed: int = 0) -> Iterator[Angles]:
        """Random poses in rad within the limits, evenly, without those in which bones intersect."""
        rng = np.random.default_rng(seed)
        while True:
            pose = {name: float(rng.uniform(*bounds)) for name, bounds in self.limits.items()}
            if not self.collides(pose):
                yield pose


def simulated(frame: Frame, layers: Iterable[Layer]) -> dict[str, Shapes]:
    """Shapes by layer and body in one frame, with those of aids, which `simulate_frame` leaves out."""
    known: dict[str, Shapes] = {}
    for layer in layers:
        if LAYERS[layer.name].role == "aid":
            known[layer.name] = layer.solve(frame, {n: known[n] for n in layer.needs if n in known})
        else:
            known |= simulate_frame(frame, [layer], known)
    return known


def finger(results: Path) -> Subject:
    """The generated finger that is built in a folder of results."""
    base = results / SUBJECT
    dataset = load_dataset(ROOT / f"config/datasets/{SUBJECT}.yaml")
    names = [*load_scene(ROOT / f"config/scenes/{SCENE}.yaml").needed]
    rig = Rig.load(base / "rig.h5")
    valid = PoseValidity(rig)
    return Subject(
        {name: [base / path for path in artifacts_of([name], dataset)] for name in names},
        rig.surfaces,
        rig.limits,
        rig.bone_transforms,
        lambda pose: bool(valid.check(pose).collisions),
        {name: pose.angles for name, pose in rig.poses.items()},
        {pose: _true_skin(base, rig, pose) for pose in TRUE_POSES},
    )


def _true_skin(base: Path, rig: Rig, pose: str) -> Surface:
    """The true skin of a pose in the frame in which the metacarpal is at rest."""
    data = true_pose([base / f"data/truth/{pose}.h5"], pose)
    [skin] = surfaces_in({"skin": data["skin"]}).values()
    return skin.moved(rig.poses[pose].root.inverse()(skin.vertices))
