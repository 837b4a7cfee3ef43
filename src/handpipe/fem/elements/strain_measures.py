"""Measures of strain and stress that other programs show."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array


def green_strains(f: Array) -> Array:
    """Green strains E = (F^T F - I) / 2 of deformation gradients.

    Parameters
    ----------
    f : array (m, 3, 3)
        Deformation gradients F.

    Returns
    -------
    array (m, 3, 3)
        Symmetric strains E, zero for a rotation.
    """
    return 0.5 * (f.transpose(0, 2, 1) @ f - np.eye(3))


def von_mises(stresses: Array) -> Array:
    """Von Mises stresses: sqrt(3/2) times the size of the deviator.

    Parameters
    ----------
    stresses : array (m, 3, 3)
        Symmetric stresses in kPa.

    Returns
    -------
    array (m,)
        Stresses in kPa; under uniaxial stress the stress itself.
    """
    mean = np.trace(stresses, axis1=1, axis2=2) / 3
    deviators = stresses - mean[:, None, None] * np.eye(3)
    return np.sqrt(1.5 * (deviators**2).sum(axis=(1, 2)))
