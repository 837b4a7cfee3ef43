"""Pseudo muscles: fibres with a strength that turn joints by lever arms (Albrecht 2003 §4.1)."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError
from handpipe.skeleton.joints.angles import Limits

TABLE = Path(__file__).with_name("pseudo_muscles.csv")
PERCENT = 2e4  # mN of a muscle with one percent of the tension of all muscles of forearm and hand
BEST, FALL = 1.1, 4.0  # stretch of the largest contraction force, and how it falls beside it
STIFFENING = 2.77  # of the force against stretch
LONGEST = 1.6  # stretch up to which there is a contraction force; from 0.6 on
RELAXED = 0.2  # of its largest flexion: a finger's joint of a hand without any contraction
FINGER_JOINTS = ("MP", "PIP", "DIP", "IP")
CAPSULE = 1e5  # mN mm per rad, of what holds a joint besides muscles: its capsule, ligaments and the skin


@dataclass(frozen=True)
class PseudoMuscles:
    """Muscles that act on joint angles.

    Parameters
    ----------
    names : tuple of str
        Names of the m muscles.
    angles : tuple of str
        Names of the k joint angles.
    rest : array (m,)
        Resting lengths of the fibres in mm.
    relaxed : array (k,)
        Angles in rad at which all fibres have their resting lengths.
    strength : array (m,)
        Largest contraction forces in mN.
    levers : array (m, k)
        Lever arms in mm: how much a muscle shortens for a unit of each angle.

    References
    ----------
    Albrecht 2003 Table 1; tension of muscles as shares: Brand and Hollister, Clinical Mechanics of the Hand,
    Mosby 1999.
    """

    names: tuple[str, ...]
    angles: tuple[str, ...]
    rest: Array
    relaxed: Array
    strength: Array
    levers: Array

    @staticmethod
    def of_limits(limits: Limits) -> PseudoMuscles:
        """The muscles of Albrecht 2003 Table 1 that act on some of a rig's angles.

        Parameters
        ----------
        limits : mapping of str to (float, float)
            Limits in rad of the rig's angles. What a muscle does at joints that the rig lacks is left out.

        Returns
        -------
        PseudoMuscles
            The muscles with a lever arm at any of the angles.

        Raises
        ------
        InputError
            If no muscle has one.
        """
        chosen = [row for row in _rows() if row["angle"] in limits]
        if not chosen:
            known = ", ".join(dict.fromkeys(row["angle"] for row in _rows()))
            problem = "no pseudo muscle acts on any of them"
            raise InputError("rig", "joints", problem, f"Contractions move {known}")
        names = tuple(dict.fromkeys(row["muscle"] for row in chosen))
        columns = tuple(limits)
        levers = np.zeros((len(names), len(columns)))
        rest, strength = np.zeros(len(names)), np.zeros(len(names))
        for row in chosen:
            i = names.index(row["muscle"])
            levers[i, columns.index(row["angle"])] = float(row["lever [mm]"])
            rest[i] = float(row["fibre_length [mm]"])
            strength[i] = PERCENT * float(row["tension [%]"])
        relaxed = np.array([RELAXED * limits[name][1] if _bends_a_finger(name) else 0.0 for name in columns])
        return PseudoMuscles(names, columns, rest, relaxed, strength, levers)

    def stretches(self, angles: Array) -> Array:
        """Fibre lengths (m,) over those at rest, at angles (k,) in rad."""
        return 1.0 - self.levers @ (angles - self.relaxed) / self.rest

    def active(self, angles: Array) -> Array:
        """Forces (m,) in mN at full contraction, without those against stretch, at angles (k,) in rad."""
        return self.strength * np.maximum(1.0 - FALL * (self.stretches(angles) - BEST) ** 2, 0.0)

    def passive(self, angles: Array) -> Array:
        """Forces (m,) in mN against stretch at angles (k,) in rad."""
        return self.strength * STIFFENING * np.maximum(self.stretches(angles) - 1.0, 0.0) ** 2

    def torques(self, angles: Array, contractions: Array) -> Array:
        """Torques (k,) in mN mm at angles (k,) in rad under contractions (m,) from 0 to 1."""
        return self.levers.T @ (contractions * self.active(angles)) + self.resistance(angles)

    def resistance(self, angles: Array) -> Array:
        """Torques (k,) in mN mm without contraction: of stretched muscles and of the joints' capsules."""
        return self.levers.T @ self.passive(angles) - CAPSULE * (angles - self.relaxed)

    def stiffness(self, angles: Array, contractions: Array) -> Array:
        """How fast torques fall as angles grow, (k, k) in mN mm: of muscles whose force rises with length.

        It is positive semidefinite; muscles whose force falls with their length are left out.
        """
        stretches = self.stretches(angles)
        falling = np.where(np.abs(stretches - BEST) < LONGEST - BEST, -2 * FALL * (stretches - BEST), 0.0)
        slopes = contractions * falling + 2 * STIFFENING * np.maximum(stretches - 1.0, 0.0)
        slopes = np.maximum(self.strength / self.rest * slopes, 0.0)
        return (self.levers.T * slopes) @ self.levers + CAPSULE * np.eye(len(angles))


def every_muscle() -> list[str]:
    """Names of all pseudo muscles, whether a rig has their joints or not.

    Returns
    -------
    list of str
        Names in the order of the table.
    """
    return [*dict.fromkeys(row["muscle"] for row in _rows())]


def _bends_a_finger(angle: str) -> bool:
    joint, _, kind = angle.partition("_")
    return kind == "flexion" and joint.rstrip("0123456789") in FINGER_JOINTS


def _rows() -> list[dict[str, str]]:
    with open(TABLE, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
