"""What is wrong with muscles as curves, before tets are made of them: one message a fault."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from handpipe.anatomy.templates.curves import PlacedAttachment, PlacedMuscle
from handpipe.core import Array, InputError
from handpipe.mesh.surfaces import Distance, Surface, arclength, closest_on_polyline, concatenate

BOTH = 2  # ends of a muscle
SLACK = 0.05  # mm beyond the skin that points on it may be, by rounding


class CurveFaults:
    """Finds curves outside the skin and muscles that are attached to no bone, or at one end only.

    Parameters
    ----------
    skin : Surface
        Closed surface in mm.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    source : path
        The file of the curves, for messages.
    """

    def __init__(self, skin: Surface, bones: Mapping[str, Surface], source: str | Path) -> None:
        self._skin, self._source = Distance(skin), source
        self._bones = Distance(concatenate(list(bones.values())))

    def of(self, muscles: Mapping[str, PlacedMuscle]) -> list[InputError]:
        """The faults of muscles.

        Parameters
        ----------
        muscles : mapping of str to PlacedMuscle
            Curves and attachments in mm by muscle.

        Returns
        -------
        list of InputError
            Each names the muscle and its field.
        """
        return [fault for name, muscle in muscles.items() for fault in self._of_one(name, muscle)]

    def doubts(self, muscles: Mapping[str, PlacedMuscle]) -> list[str]:
        """Sentences on muscles of which one end alone is on a bone.

        Parameters
        ----------
        muscles : mapping of str to PlacedMuscle
            Curves and attachments in mm by muscle.

        Returns
        -------
        list of str
        """
        gaps = {name: self._gaps(muscle) for name, muscle in muscles.items()}
        return [
            f"{name}: {sentence}: right for a muscle that is attached to another organ there"
            for name, found in gaps.items()
            if len(found) == 1
            for sentence in found.values()
        ]

    def of_extent(self, name: str, muscle: PlacedMuscle, points: Array, edge: float) -> list[InputError]:
        """The faults of a muscle that ends far from where it is attached.

        Parameters
        ----------
        name : str
            The muscle.
        muscle : PlacedMuscle
            Its attachments in mm.
        points : array (p, 3)
            Points in mm all over the muscle and on its surface.
        edge : float
            Edge length of tets in mm, by which an end may be farther away than its reach.

        Returns
        -------
        list of InputError
        """
        ends = {"origin": muscle.origins, "insertion": muscle.insertions}
        return [
            fault
            for end, attachments in ends.items()
            for attachment in attachments
            for fault in self._short(f"muscles.{name}", end, attachment, (points, edge))
        ]

    def _short(
        self, field: str, end: str, attachment: PlacedAttachment, extent: tuple[Array, float]
    ) -> Iterator[InputError]:
        points, edge = extent
        line = np.concatenate([attachment.points, attachment.points[-1:]])
        nearest = closest_on_polyline(points, line)[3].min()
        if nearest > attachment.reach + edge:
            place = ", ".join(f"{c:.1f}" for c in attachment.points[0])
            problem = f"the muscle ends {nearest:.1f} mm from its {end} at ({place})"
            remedy = f"Raise the tissue value there, or `reach` ({attachment.reach:g} mm)"
            yield InputError(self._source, field, problem, remedy)

    def _of_one(self, name: str, muscle: PlacedMuscle) -> Iterator[InputError]:
        for number, curve in enumerate(muscle.curves):
            yield from self._outside(f"muscles.{name}.curves.{number}", curve.points)
        gaps = self._gaps(muscle)
        if len(gaps) == BOTH:
            problem = f"is attached to no bone: {' and '.join(gaps.values())}"
            remedy = "Place the first or the last point of a curve on a bone"
            yield InputError(self._source, f"muscles.{name}", problem, remedy)

    def _outside(self, field: str, points: Array) -> Iterator[InputError]:
        """The fault of a curve that leaves the skin."""
        outside = ~self._skin.surface.contains(points)
        outside[outside] = self._skin.closest(points[outside])[0] > SLACK
        if not outside.any():
            return
        steps = np.diff(arclength(points))
        length = steps[outside[:-1] | outside[1:]].sum()
        place = ", ".join(f"{c:.1f}" for c in points[np.flatnonzero(outside)[outside.sum() // 2]])
        problem = f"{length:.1f} mm of it lie outside the skin, near ({place})"
        yield InputError(self._source, field, problem, "Move its points into the skin")

    def _gaps(self, muscle: PlacedMuscle) -> dict[str, str]:
        """A sentence on each end that no attachment joins to a bone."""
        found = {}
        for end, attachments in {"origin": muscle.origins, "insertion": muscle.insertions}.items():
            distances = np.array([self._bones.closest(a.points)[0].min() for a in attachments])
            if (distances > [a.reach for a in attachments]).all():
                nearest = int(np.argmin(distances))
                reach = f"beyond its reach of {attachments[nearest].reach:g} mm"
                found[end] = f"its {end} lies {distances[nearest]:.1f} mm from the nearest bone, {reach}"
        return found
