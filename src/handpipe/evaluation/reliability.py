"""Whether stated deviations hold: coverage, and larger errors where larger ones are stated."""

from __future__ import annotations

import numpy as np
from scipy.stats import spearmanr

from handpipe.core import Array, Metrics
from handpipe.evaluation.table import Row

GROUPS = 10  # of points, from those with the least stated deviations to those with the largest


def coverage(errors: Array, stated: Array, deviations: float = 2.0) -> float:
    """Share of errors that are within some of their stated deviations.

    Parameters
    ----------
    errors, stated : array (n,)
        True errors and stated deviations in mm.
    deviations : float
        Number of deviations.

    Returns
    -------
    float
        Share in 0..1.
    """
    return float(np.mean(errors <= deviations * stated))


def reliability_metrics(errors: Array, stated: Array, suffix: str) -> Metrics:
    """Coverage, rank correlation, and root mean squares of errors and of stated deviations.

    Parameters
    ----------
    errors, stated : array (n,)
        True errors and stated deviations in mm.
    suffix : str
        End of the names.

    Returns
    -------
    Metrics
        `coverage_two_deviations`, `coverage_one_deviation`, `rank_correlation` (Spearman's, absent where the
        stated deviations are all alike), `error` and `stated` in mm.
    """
    found: Metrics = {
        f"coverage_two_deviations_{suffix}": (coverage(errors, stated), "1"),
        f"coverage_one_deviation_{suffix}": (coverage(errors, stated, 1.0), "1"),
        f"error_{suffix}": (float(np.sqrt(np.mean(errors**2))), "mm"),
        f"stated_{suffix}": (float(np.sqrt(np.mean(stated**2))), "mm"),
    }
    if np.ptp(stated) > 0 and np.ptp(errors) > 0:
        found[f"rank_correlation_{suffix}"] = (float(spearmanr(errors, stated).statistic), "1")
    return found


def reliability_rows(errors: Array, stated: Array) -> list[Row]:
    """A reliability table: points in equal groups by their stated deviations, the least first.

    Parameters
    ----------
    errors, stated : array (n,)
        True errors and stated deviations in mm.

    Returns
    -------
    list of Row
        `group` from 1, `stated` and `error` (root mean squares, mm), `coverage` of two deviations.
    """
    order = np.argsort(stated, kind="stable")
    return [
        {
            "group": float(number),
            "stated": float(np.sqrt(np.mean(stated[part] ** 2))),
            "error": float(np.sqrt(np.mean(errors[part] ** 2))),
            "coverage": coverage(errors[part], stated[part]),
        }
        for number, part in enumerate(np.array_split(order, GROUPS), start=1)
        if len(part)
    ]
