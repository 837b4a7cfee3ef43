"""Volume on disk and in space.

A NIfTI file is read into RAS millimetres, whatever the order of its axes. The volume is sampled at a point in
space.
"""

import tempfile
from pathlib import Path

import nibabel as nib
import numpy as np

from handpipe.imaging.volumes import read_volume

values = np.zeros((8, 9, 10), np.float32)
values[2, 3, 4] = 100.0
affine = np.diag([-0.5, 0.5, 0.5, 1.0])  # the first axis points to the left
affine[:3, 3] = [10.0, 0.0, 5.0]

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "scan.nii.gz"
    nib.save(nib.Nifti1Image(values, affine), path)
    volume = read_volume(path)

point = (affine @ [2, 3, 4, 1])[:3]
print("spacing", volume.spacing, "mm; value at", point, "is", volume.sample(point[None]))
assert np.isclose(volume.sample(point[None])[0], 100.0)
