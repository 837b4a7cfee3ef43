"""A first scene of a new subject: it bends in the joints that it has, far less than their limits.

Angles of ball joints about axes of the image are no motion of a limb. A subject without flexions therefore
moves from one scanned pose to the next.
"""

from __future__ import annotations

from pathlib import Path

from handpipe.core import write_text
from handpipe.core.configuration import Dataset, Joint

INNER = ("bones", "bone_fascia", "tendons", "muscles", "muscle_fascia", "ligaments")
LAYERS = (*INNER, "fat", "skin")
BONES = ("bones",)
BONES_IN_SKIN = ("bones", "skin")  # of a part without organs
SHARES = {"rest": 0.0, "bent1": 0.1, "bent2": 0.2}  # frames; shares of the largest flexion of each joint
STEP = 4  # frames from one scanned pose to the next
BENDS = "three frames, each joint bent by up to a fifth of its largest flexion"
POSES = "from neutral to each scanned pose and back"
SCENE = """\
# Written by `handpipe init`: {motion}.
layers: [{layers}]
frames: {frames}
chunk: {chunk}
"""


def scene_files(name: str) -> tuple[Path, Path]:
    """The scene file and the file of its frames, for a subject's name."""
    return Path(f"config/scenes/{name}.yaml"), Path(f"config/scenes/{name}.csv")


def write_first_scene(name: str, dataset: Dataset) -> tuple[Path, Path]:
    """Write a scene with every layer that the subject can have.

    Parameters
    ----------
    name : str
        The subject's, and so the scene's.
    dataset : Dataset
        Joints with their limits, and what gives the skin.

    Returns
    -------
    tuple of path
        As of `scene_files`.
    """
    posed = _between_poses(dataset)
    rows, motion, chunk = (posed, POSES, STEP) if posed else (_bends(dataset), BENDS, 1)
    scene, frames = scene_files(name)
    inner, whole = (INNER, LAYERS) if dataset.muscles or dataset.tendons else (BONES, BONES_IN_SKIN)
    layers = whole if dataset.has_skin(dataset.neutral) else inner
    write_text(frames, "\n".join(rows) + "\n")
    write_text(scene, SCENE.format(motion=motion, layers=", ".join(layers), frames=frames, chunk=chunk))
    return scene, frames


def _bends(dataset: Dataset) -> list[str]:
    """A table of joint angles."""
    largest = dict(bend for joint in dataset.joints.values() if (bend := _bend(joint)))
    rows = [",".join(["frame", *(f"{angle} [deg]" for angle in largest)])]
    return rows + [
        ",".join([frame, *(f"{share * limit:.1f}" for limit in largest.values())])
        for frame, share in SHARES.items()
    ]


def _between_poses(dataset: Dataset) -> list[str]:
    """A table of keyframes through the examples; empty where there are none, or joints have flexions."""
    examples = dataset.examples
    angles = [angle for joint in dataset.joints.values() for angle in joint.angles]
    if not examples or any(angle.endswith("flexion") for angle in angles):
        return []
    keys = [dataset.neutral]
    for pose in examples:
        keys += [pose, dataset.neutral]
    names = [f"{key}-{i}" if key in keys[:i] else key for i, key in enumerate(keys)]
    rows = zip(names, keys, strict=True)
    return ["key,time [frame],pose", *(f"{name},{STEP * i},{key}" for i, (name, key) in enumerate(rows))]


def _bend(joint: Joint) -> tuple[str, float] | None:
    """The joint's flexion, or its first angle where none is called so, with its upper limit in deg."""
    angles = dict(zip(joint.angles, joint.limits_deg or (), strict=False))
    chosen = next((name for name in angles if name.endswith("flexion")), next(iter(angles), None))
    return None if chosen is None else (chosen, angles[chosen][1])
