"""What a dataset gives in the frame of its templates, carried onto the subject's bones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from handpipe.core import Array, Metrics, artifacts
from handpipe.core.configuration import Dataset
from handpipe.imaging.evidence import read_markers
from handpipe.mesh.files import read_surface
from handpipe.mesh.surfaces import Biharmonic, Surface
from handpipe.tissues.muscles.fitting import BoneWarp, Rival, through_points

KIND = "carried_template"


@dataclass(frozen=True)
class CarriedTemplate:
    """Axis hints, tendons' paths and nails in the neutral image.

    Parameters
    ----------
    axis_hints : mapping of str to array (k, 3)
        Rough axes of each joint.
    paths : mapping of str to array (n, 3)
        Points in mm along each tendon, from its insertion outwards.
    nails : mapping of str to Surface
        Patch of each nail, near the skin.
    points : tuple of two array (n, 3)
        Points in mm of the template bones, and where they lie on the subject's: what defines the map.
    rival : Rival, optional
        Another place of the template bones that fits nearly as well.
    """

    axis_hints: Mapping[str, Array]
    paths: Mapping[str, Array]
    nails: Mapping[str, Surface]
    points: tuple[Array, Array]
    rival: Rival | None = None

    @staticmethod
    def onto(dataset: Dataset, bones: Mapping[str, Surface]) -> CarriedTemplate:
        """Carry by the map of the templates of bones onto a subject's bones (Wang 2021 §6.1).

        A joint's axes turn as its parent does, or its child where the parent has no counterpart.

        Parameters
        ----------
        dataset : Dataset
            Whose joints, tendons and nails are in the frame of its templates.
        bones : mapping of str to Surface
            Whole bones of the subject in neutral.

        Returns
        -------
        CarriedTemplate
            In the frame of `bones`.

        Raises
        ------
        InputError
            For a file that cannot be read.
        ConvergenceError
            For a bone that is too unlike its template.
        """
        templates = {
            name: read_surface(dataset.path(bone.template), closed=True)
            for name, bone in dataset.bones.items()
            if bone.template is not None and name in bones
        }
        warp = BoneWarp(templates, {name: bones[name] for name in templates})
        turns = {name: polar(affine.matrix)[0] for name, affine in warp.registered.items()}
        common = Rotation.from_matrix(np.stack([*turns.values()])).mean().as_matrix()
        hints = {}
        for name, joint in dataset.joints.items():
            turn = next((turns[bone] for bone in (joint.parent, joint.child) if bone in turns), common)
            hints[name] = np.reshape(joint.axis_hints, (-1, 3)) @ turn.T
        paths = {
            name: warp(read_markers(dataset.path(tendon.path))[0]) for name, tendon in dataset.tendons.items()
        }
        patches = {name: read_surface(dataset.path(nail.surface)) for name, nail in dataset.nails.items()}
        nails = {n: p.moved(warp(p.vertices)) for n, p in patches.items()}
        return CarriedTemplate(hints, paths, nails, warp.points, warp.rival)

    def warp(self) -> Biharmonic:
        """The map that carried all this, from the template's frame to the subject's."""
        return through_points(*self.points)

    def figures(self) -> Metrics:
        """How sure the place of the template bones is: empty where no other place fits nearly as well."""
        if self.rival is None:
            return {}
        return {
            "template_error": (self.rival.error, "mm"),
            "template_error_turned": (self.rival.turned, "mm"),
            "template_turn": (self.rival.turn, "deg"),
        }

    def in_place(self, dataset: Dataset) -> Dataset:
        """The dataset with the carried axis hints in place of those of its template."""
        joints = {
            name: joint.model_copy(update={"axis_hints": tuple(map(tuple, self.axis_hints[name]))})
            for name, joint in dataset.joints.items()
        }
        return dataset.model_copy(update={"joints": joints})

    def save(self, path: str | Path, inputs: Sequence[str | Path]) -> None:
        """Write as an artifact of kind "carried_template"."""
        nails = {n: {"vertices": s.vertices, "triangles": s.triangles} for n, s in self.nails.items()}
        points = dict(zip(("source", "target"), self.points, strict=True))
        data = {
            "axis_hints": dict(self.axis_hints),
            "paths": dict(self.paths),
            "nails": nails,
            "warp": points,
        }
        if self.rival is not None:
            data["rival"] = asdict(self.rival)
        units = {f"paths/{name}": "mm" for name in self.paths}
        units |= {f"warp/{name}": "mm" for name in points}
        units |= {f"nails/{name}/vertices": "mm" for name in nails}
        artifacts.write(path, data, kind=KIND, units=units, inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> CarriedTemplate:
        """Read what `save` wrote; raises `InputError` where the file is of another kind."""
        d = artifacts.read(path, KIND)
        nails = {n: Surface(g["vertices"], g["triangles"]) for n, g in d.get("nails", {}).items()}
        points = d["warp"]["source"], d["warp"]["target"]
        rival = Rival(**{name: float(x) for name, x in d["rival"].items()}) if "rival" in d else None
        return CarriedTemplate(d["axis_hints"], d.get("paths", {}), nails, points, rival)


def with_carried_hints(dataset: Dataset, carried: Path | None) -> Dataset:
    """The dataset as a stage uses it.

    Parameters
    ----------
    dataset : Dataset
        As its file says.
    carried : path or None
        Artifact with what was carried; None where the dataset gives its hints in the neutral image.

    Returns
    -------
    Dataset
        With axis hints in the neutral image.
    """
    return dataset if carried is None else CarriedTemplate.load(carried).in_place(dataset)
