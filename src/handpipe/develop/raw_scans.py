"""`python -m handpipe.develop.raw_scans SUBJECT FOLDER`: a generated subject's scans as scanners write them.

Each pose is a DICOM series in a folder of its own, tilted against the scanner's axes, with its skin scan as
STL beside it. Strokes of the neutral pose are written with `--strokes`, as a segmentation of 3D Slicer.
With `--mirrored` they are those of the other hand. Nothing else of the subject is written: the folder is what
`handpipe init` is made for.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pydicom
from pydicom.dataset import FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, MRImageStorage, generate_uid
from scipy.spatial.transform import Rotation

from handpipe.core import Array, InputError, Parser, RigidTransform, run
from handpipe.core.configuration import Dataset, load_dataset
from handpipe.imaging.segmentation import BACKGROUND
from handpipe.imaging.volumes import Volume, read_labels, read_volume, write_segments
from handpipe.mesh.files import read_surface, write_surface
from handpipe.mesh.surfaces import Surface

TILT = RigidTransform(
    Rotation.from_rotvec([14.0, -9.0, 21.0], degrees=True).as_matrix(), np.array([31.0, -52.0, 640.0])
)  # deg and mm, from the subject's frame to the scanner's
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])  # from a hand to the other one, in the subject's frame
LARGEST = 4095  # value of a pixel: twelve bits, as scanners store
LPS = np.array([-1.0, -1.0, 1.0])  # signs from one convention of axes to the other


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 if it succeeded, 1 with a line that says why not."""
    parser = Parser(prog="python -m handpipe.develop.raw_scans", description=__doc__)
    parser.add_argument("subject", metavar="SUBJECT", help="with its data generated: snakemake data")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where to; must not exist")
    parser.add_argument("--strokes", action="store_true", help="write the strokes of the neutral pose, too")
    parser.add_argument("--poses", nargs="+", metavar="POSE", help="these alone")
    parser.add_argument("--mirrored", action="store_true", help="of the other hand")
    parser.set_defaults(run=_write)
    return run(parser, arguments)


def _write(options: argparse.Namespace) -> None:
    dataset = load_dataset(f"config/datasets/{options.subject}.yaml")
    if options.folder.exists():
        raise InputError(options.folder, "folder", "exists already", "Name another one")
    to_scanner = scanner_transform(mirrored=options.mirrored)
    for number, name in enumerate(options.poses or dataset.poses, 1):
        pose = dataset.poses[name]
        volume = moved(read_volume(dataset.path(pose.volume)), to_scanner)
        write_dicom(options.folder / f"{name} MR", volume, number)
        if pose.scan is not None:
            scan = read_surface(dataset.path(pose.scan))
            write_surface(options.folder / f"{name} skin.stl", moved_surface(scan, to_scanner))
        print(options.folder / f"{name} MR")
    if options.strokes:
        _write_strokes(options.folder, dataset, to_scanner)


def _write_strokes(folder: Path, dataset: Dataset, to_scanner: Array) -> None:
    pose = dataset.poses[dataset.neutral]
    if pose.seeds is None:
        raise InputError(dataset.neutral, "seeds", "there are none", "Leave out --strokes")
    volume = read_volume(dataset.path(pose.volume))
    labels = read_labels(dataset.path(pose.seeds), volume, dataset.labels)
    path = folder / f"{dataset.neutral}-seeds.seg.nrrd"
    write_segments(
        path, labels, moved(volume, to_scanner).affine, dataset.labels | {"background": BACKGROUND}
    )
    print(path)


def scanner_transform(*, mirrored: bool = False) -> Array:
    """Where the scans lie.

    Parameters
    ----------
    mirrored : bool
        Whether they are those of the other hand.

    Returns
    -------
    array (4, 4)
        From the subject's frame to the scanner's, in mm.
    """
    tilt = np.eye(4)
    tilt[:3, :3], tilt[:3, 3] = TILT.rotation, TILT.translation
    return tilt @ MIRROR if mirrored else tilt


def moved(volume: Volume, to_scanner: Array) -> Volume:
    """The volume with its grid moved; voxels keep their values.

    Parameters
    ----------
    volume : Volume
        Any.
    to_scanner : array (4, 4)
        From the volume's frame to the new one, in mm; it may be a reflection.

    Returns
    -------
    Volume
        With another affine.
    """
    return Volume(volume.values, to_scanner @ volume.affine)


def moved_surface(surface: Surface, to_scanner: Array) -> Surface:
    """The surface in the new frame, its triangles outward also after a reflection.

    Parameters
    ----------
    surface : Surface
        Any, in mm.
    to_scanner : array (4, 4)
        As in `moved`.

    Returns
    -------
    Surface
        With other vertices.
    """
    reflected = np.linalg.det(to_scanner[:3, :3]) < 0
    vertices = surface.vertices @ to_scanner[:3, :3].T + to_scanner[:3, 3]
    return Surface(vertices, (surface.flipped() if reflected else surface).triangles)


def write_dicom(folder: Path, volume: Volume, number: int) -> None:
    """Write a volume as a series of DICOM MR images of twelve bits.

    Parameters
    ----------
    folder : path
        Made; one file a slice.
    volume : Volume
        Values of zero and above, RAS mm.
    number : int
        Of the series in its study.
    """
    folder.mkdir(parents=True)
    affine = volume.affine * np.append(LPS, 1.0)[:, None]
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    slope = float(volume.values.max()) / LARGEST or 1.0
    pixels = np.round(np.clip(volume.values / slope, 0, LARGEST)).astype("<u2")
    series, frame, study = generate_uid(), generate_uid(), generate_uid()
    for k in range(pixels.shape[2]):
        image = pydicom.Dataset()
        image.file_meta = FileMetaDataset()
        image.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        image.file_meta.MediaStorageSOPClassUID = image.SOPClassUID = MRImageStorage
        image.file_meta.MediaStorageSOPInstanceUID = image.SOPInstanceUID = generate_uid()
        image.Modality, image.PatientName, image.PatientID = "MR", "generated", "generated"
        image.StudyInstanceUID, image.SeriesInstanceUID, image.FrameOfReferenceUID = study, series, frame
        image.SeriesNumber, image.InstanceNumber = number, k + 1
        image.ImageOrientationPatient = _decimals((affine[:3, :2] / spacing[:2]).T.ravel())
        image.ImagePositionPatient = _decimals(affine[:3, 3] + k * affine[:3, 2])
        image.PixelSpacing = _decimals(spacing[[1, 0]])
        image.SliceThickness = _decimals(spacing[2:])[0]
        image.Rows, image.Columns = pixels.shape[1], pixels.shape[0]
        image.SamplesPerPixel, image.PhotometricInterpretation = 1, "MONOCHROME2"
        image.BitsAllocated, image.BitsStored, image.HighBit, image.PixelRepresentation = 16, 12, 11, 0
        image.RescaleSlope, image.RescaleIntercept = _decimals(np.array([slope]))[0], "0"
        image.PixelData = pixels[:, :, k].T.tobytes()
        image.save_as(folder / f"IM-{number:04d}-{k + 1:04d}.dcm", enforce_file_format=True)


def _decimals(values: np.ndarray) -> list[str]:
    """Numbers as DICOM's decimal strings, of sixteen characters at most."""
    return [f"{value:.9g}" for value in values]


if __name__ == "__main__":
    sys.exit(main())
