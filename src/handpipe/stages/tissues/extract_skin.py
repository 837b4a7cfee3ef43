"""The skin of a pose without a scan, from its volume: it takes the scan's place."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError, RigidTransform, metrics
from handpipe.core.configuration import Dataset
from handpipe.imaging.skin import PosedBones, VolumeSkin, skin_of_volume
from handpipe.imaging.volumes import pose_volume
from handpipe.mesh.files import read_scan, write_surface
from handpipe.mesh.surfaces import each_moved
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files

log = logging.getLogger(__name__)

LEAST_SURE = 0.8  # of the skin: with less, the image shows it badly


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    volume: Path
    rig: Path
    neutral: Path | None = None


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    surface: Path
    figures: Path


def extract_skin(inputs: Inputs, outputs: Outputs, dataset: Dataset, pose: str) -> None:
    """The skin of a pose from its volume, open where the limb leaves the image, and its figures."""
    found: metrics.Metrics = {}
    with metrics.measured(found):
        volume = pose_volume(dataset, pose)
        bones = _posed_bones(inputs, pose, pose == dataset.neutral)
        try:
            skin = skin_of_volume(volume, bones)
        except InputError as error:
            field = f"{error.field} of pose {pose}"
            remedy = f"{error.remedy}; or give a scan of the skin (poses.{pose}.scan)"
            raise InputError(inputs.volume, field, error.problem, remedy) from error
    _warn(pose, skin)
    write_surface(outputs.surface, skin.open)
    metrics.write(outputs.figures, found | _figures(skin))


def _posed_bones(inputs: Inputs, pose: str, is_neutral: bool) -> PosedBones | None:
    """The bones of a pose in its image, as the rig explains them; None where the rig lacks the pose."""
    rig = Rig.load(inputs.rig)
    joints = [(joint.parent, joint.child) for joint in rig.joints]
    if is_neutral:
        return PosedBones(rig.surfaces, joints)
    if pose not in rig.poses:
        log.warning("%s: the rig does not explain this pose: parts that touch stay joined", pose)
        return None
    root = rig.poses[pose].root
    motions: dict[str, RigidTransform] = {
        bone: root @ moved for bone, moved in rig.scanned_bones(pose).items()
    }
    surfaces = each_moved({bone: rig.surfaces[bone] for bone in motions}, motions)
    neutral = None if inputs.neutral is None else read_scan(inputs.neutral)
    return PosedBones(surfaces, joints, motions, neutral)


def _figures(skin: VolumeSkin) -> metrics.Metrics:
    return {
        "sure": (skin.sure, ""),
        "handles": (float(skin.handles), ""),
        "open_ends": (float(skin.ends), ""),
        "contact_faces": (float(skin.contact_faces), ""),
        "other_parts": (float(skin.others), ""),
    }


def _warn(pose: str, skin: VolumeSkin) -> None:
    """Name what is doubtful of a skin."""
    if skin.sure < LEAST_SURE:
        share = 100 * skin.sure
        log.warning("%s: the image shows the skin clearly at %.0f %% of it alone: look at it", pose, share)
    if skin.handles > 0:
        log.warning(
            "%s: the skin has %d handles: parts of the limb touch and stay joined", pose, skin.handles
        )
    if skin.ends > 1:
        log.warning("%s: the border of the image cuts the limb in %d places", pose, skin.ends)
    if skin.others > 0:
        log.warning("%s: %d other large parts in the image are not in the skin", pose, skin.others)
    log.info(
        "%s: skin of %d vertices, %d open ends, parts told apart at %d faces of voxels",
        *(pose, len(skin.open.vertices), skin.ends, skin.contact_faces),
    )
