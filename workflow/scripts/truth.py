"""The truth of a generated subject, and bones' transforms against it."""

import numpy as np

from handpipe import artifacts
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface


def true_pose(dataset, pose):
    """All that is true in a pose, in its own frame (kind "truth")."""
    return artifacts.read(dataset.path(dataset.truth.folder) / f"{pose}.h5", "truth")


def surfaces_in(group):
    """Surfaces by name of a truth's group of organs."""
    return {name: Surface(d["vertices"], d["triangles"]) for name, d in group.items()}


def bone_errors(dataset, pose, found, centroids):
    """Angles in deg and distances of centroids in mm between found and true transforms, a bone each."""
    truth = true_pose(dataset, pose)["bones"]
    rotations, translations = [], []
    for bone, centroid in centroids.items():
        true = RigidTransform(truth[bone]["rotation"], truth[bone]["translation"])
        rotations.append(np.degrees(found[bone].angle_to(true)))
        translations.append(np.linalg.norm(found[bone](centroid[None]) - true(centroid[None])))
    return rotations, translations
