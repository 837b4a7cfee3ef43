"""Measured hands: lengths of bones of a median man, and outer measures of people, each with its source.

Bones (`phantom_hand_bones.RAYS`): Buryanov and Kotiuk 2010, "Proportions of hand segments", a median man, as
compiled second hand with the project's reference measurements. Outer measures of adults: ANSUR II, the survey
of 4,082 men and 1,986 women of the US Army (Gordon et al. 2014, "2012 Anthropometric Survey of U.S. Army
Personnel: Methods and Summary Statistics", NATICK/TR-15/007; the public files of single subjects, evaluated
here: means of the group that each entry names). The child: see its entry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class MeasuredPerson:
    """Outer measures of a hand in mm.

    Parameters
    ----------
    length : float
        From the wrist's crease to the tip of the middle finger.
    palm : float
        From the wrist's crease to the base of the middle finger.
    breadth : float
        Across the heads of metacarpals II to V.
    circumference : float or None
        About the same heads; None where it was not measured.
    source : str
        Where the figures are from.
    """

    length: float
    palm: float
    breadth: float
    circumference: float | None
    source: str

    @property
    def finger(self) -> float:
        """Length in mm of the middle finger from its base."""
        return self.length - self.palm

    @property
    def thickness(self) -> float | None:
        """Thickness in mm at the heads: that of two half circles and a straight part as long around."""
        if self.circumference is None:
            return None
        return (self.circumference - 2.0 * self.breadth) / (math.pi - 2.0)


# To which the bones of the median man belong.
MEDIAN_MAN = MeasuredPerson(193.28, 116.46, 88.26, 212.28, "ANSUR II, mean of 4,082 men")

PEOPLE = {
    "child": MeasuredPerson(
        130.0,
        130.0 * MEDIAN_MAN.palm / MEDIAN_MAN.length,
        55.0,
        None,
        "Length and breadth of boys of six: size 130/55 of GB/T 26159-2010, Hand sizing system of Chinese "
        "minors, as a survey of 480 children assigns it (Journal of Zhejiang Sci-Tech University, Natural "
        "Sciences, 53(4), 498-506, 2025, abstract). The share of the palm is the median man's; the thickness "
        "was not measured and is as the breadth's.",
    ),
    "woman": MeasuredPerson(181.08, 108.70, 78.15, 186.55, "ANSUR II, mean of 1,986 women"),
    "large-man": MeasuredPerson(
        215.86, 128.34, 94.14, 226.10, "ANSUR II, mean of the 185 men whose hands are the longest twentieth"
    ),
    "long-fingers": MeasuredPerson(
        198.39,
        110.14,
        89.05,
        213.94,
        "ANSUR II, mean of the 100 men with the longest fingers for their hands",
    ),
    "left": MEDIAN_MAN,
}
