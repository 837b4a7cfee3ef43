"""Pseudo muscles against formulas of the paper, another integrator, and energies of moving points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from five_fingers import posed, random_angles, rig
from scipy.integrate import solve_ivp

from handpipe.core.configuration import load_scene
from handpipe.core.errors import InputError
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.__main__ import main
from handpipe.skeleton.contraction import (
    HandState,
    MuscleDrive,
    PseudoMuscles,
    angles_of_contractions,
    contractions_of_angles,
    every_muscle,
)
from handpipe.skeleton.contraction.dynamics import FRICTION
from handpipe.skeleton.contraction.inertia import DENSITY, ENVELOPE, BoneMasses, cylinder_points
from handpipe.skeleton.contraction.pseudo_muscles import CAPSULE
from handpipe.skeleton.motion import expand_motion, is_motion, motion_frame_names

ROOT = Path(__file__).parents[2]
RIG = rig()
DRIVE = MuscleDrive.of_rig(RIG)
MUSCLES = DRIVE.muscles
TABLE = """contraction,time [frame],flexor_digitorum_profundus_2,flexor_carpi_ulnaris
rest,0,0,0
bent,12,0.6,
held,18.5,0.6,1
"""


KEYS = """key,time [frame],MP2_flexion [deg],PIP2_flexion [deg],DIP2_flexion [deg]
open,0,18,22,16
bent,12,40,50,30
"""


class OneMass:
    """A joint with a moment of inertia of its own."""

    def matrix(self, _):
        return np.array([[40.0]])


def one_joint():
    """Two muscles that bend and stretch one hinge."""
    muscles = PseudoMuscles(
        ("bends", "stretches"), ("hinge",), np.array([60.0, 50.0]), np.zeros(1), np.array([5e4, 3e4]),
        np.array([[10.0], [-8.0]]),
    )  # fmt: skip
    return MuscleDrive(muscles, OneMass(), np.array([-1.0]), np.array([1.6]))


def test_forces_are_those_of_the_paper():
    muscles = one_joint().muscles
    at = lambda stretch: np.array([(1.0 - stretch) * 60.0 / 10.0])  # noqa: E731
    for stretch in (0.7, 1.0, 1.1, 1.3):
        assert muscles.active(at(stretch))[0] == pytest.approx(5e4 * (1 - 4 * (stretch - 1.1) ** 2))
        assert muscles.passive(at(stretch))[0] == pytest.approx(5e4 * 2.77 * max(stretch - 1, 0) ** 2)
    assert muscles.active(at(0.55))[0] == 0.0 and muscles.active(at(1.65))[0] == 0.0


def test_lever_arms_and_fibres_are_those_of_table_1():
    muscle = MUSCLES.names.index("flexor_digitorum_profundus_2")
    arms = dict(zip(MUSCLES.angles, MUSCLES.levers[muscle], strict=True))
    assert MUSCLES.rest[muscle] == 66.0
    assert (arms["MP2_flexion"], arms["PIP2_flexion"], arms["DIP2_flexion"]) == (11.1, 7.9, 4.1)
    assert not any(arm for name, arm in arms.items() if "2_" not in name)
    assert "flexor_carpi_ulnaris" in every_muscle() and "flexor_carpi_ulnaris" not in MUSCLES.names


def test_stiffness_is_the_derivative_of_torques_where_forces_rise_with_length():
    angles, contractions = MUSCLES.relaxed + 0.02, np.full(len(MUSCLES.names), 0.3)
    step = 1e-6
    slopes = [
        (MUSCLES.torques(angles + e, contractions) - MUSCLES.torques(angles - e, contractions)) / (2 * step)
        for e in step * np.eye(len(angles))
    ]
    # all fibres are shorter than 1.1 of their rest there
    assert np.all(MUSCLES.stretches(angles) < 1.1)
    np.testing.assert_allclose(
        MUSCLES.stiffness(angles, contractions), -np.array(slopes), atol=1e-3 * CAPSULE
    )


def test_steps_converge_to_another_integrator_with_first_order():
    drive, contractions = one_joint(), np.array([0.5, 0.1])

    def rates(_, state):
        torque = drive.muscles.torques(state[:1], contractions)[0] - FRICTION * state[1]
        return [state[1], torque / 40.0]

    exact = solve_ivp(rates, (0.0, 0.2), [0.1, 0.0], method="Radau", rtol=1e-10, atol=1e-12).y[0, -1]
    errors = []
    for count in (50, 100, 200):
        state = HandState(np.array([0.1]), np.zeros(1))
        for _ in range(count):
            state = drive.step(state, contractions, np.array([[40.0]]), 0.2 / count)
        errors.append(abs(state.angles[0] - exact))
    assert errors[-1] < 2e-3 * abs(exact - 0.1)
    assert 1.8 < errors[0] / errors[1] < 2.2 and 1.8 < errors[1] / errors[2] < 2.2


def test_a_thin_bone_has_the_moment_of_inertia_of_equation_5():
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.column_stack([np.zeros(24), 2 * np.cos(angle), 2 * np.sin(angle)])
    vertices = np.concatenate([ring, ring + [50.0, 0, 0], [[0.0, 0, 0], [50.0, 0, 0]]])
    i, j = np.arange(24), (np.arange(24) + 1) % 24
    sides = np.concatenate([np.stack([i, j, 24 + i], 1), np.stack([j, 24 + j, 24 + i], 1)])
    ends = np.concatenate(
        [np.stack([j, i, np.full(24, 48)], 1), np.stack([24 + i, 24 + j, np.full(24, 49)], 1)]
    )
    bone = Surface(vertices, np.concatenate([sides, ends]))
    points, mass = cylinder_points(bone), ENVELOPE * DENSITY * abs(bone.volume())
    about_end = mass / 6 * (points[:, [0, 1]] ** 2).sum()
    assert about_end == pytest.approx(mass * 50.0**2 / 3, rel=0.01)
    np.testing.assert_allclose(points.mean(axis=0), [25.0, 0, 0], atol=1e-9)


def test_the_mass_matrix_gives_the_kinetic_energy_of_points_moved_by_other_formulas():
    masses, angles = BoneMasses.of_rig(RIG), random_angles(3, 0.4)
    rates = np.random.default_rng(1).normal(size=len(RIG.angle_names))
    at = np.array([angles[name] for name in RIG.angle_names])
    step = 1e-5

    def moved(sign):
        values = dict(zip(RIG.angle_names, at + sign * step * rates, strict=True))
        return {b: np.array([posed(p, b, values)[0] for p in points]) for b, points in masses.points.items()}

    ahead, behind = moved(1), moved(-1)
    energy = sum(
        0.5 * masses.masses[bone] * (((ahead[bone] - behind[bone]) / (2 * step)) ** 2).sum() for bone in ahead
    )
    assert 0.5 * rates @ masses.matrix(at) @ rates == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("seconds", [1 / 240, 1 / 24, 1.0])
def test_any_contractions_leave_the_hand_within_limits_and_bring_it_to_rest(seconds):
    random = np.random.default_rng(5)
    state = HandState(MUSCLES.relaxed, np.zeros(len(MUSCLES.relaxed)))
    for _ in range(20):
        before, after = random.integers(0, 2, size=(2, len(MUSCLES.names))).astype(float)
        state = DRIVE.frame(state, before, after, seconds)
        assert np.isfinite(state.rates).all()
        assert np.all((state.angles >= DRIVE.lower) & (state.angles <= DRIVE.upper))
    at_rest = DRIVE.resting(after, state.angles)
    torques = MUSCLES.torques(at_rest.angles, after)
    free = (at_rest.angles > DRIVE.lower) & (at_rest.angles < DRIVE.upper)
    assert np.abs(torques[free]).max() < 1e-3 * FRICTION  # they turn a joint by 0.06 deg a second at most
    assert np.all(torques[at_rest.angles == DRIVE.upper] > 0)  # and push against the limits they are at
    assert np.all(torques[at_rest.angles == DRIVE.lower] < 0)


def test_without_contraction_the_hand_is_relaxed_and_a_flexor_bends_its_own_finger():
    still = DRIVE.resting(np.zeros(len(MUSCLES.names)), np.zeros(len(MUSCLES.relaxed)))
    np.testing.assert_allclose(still.angles, MUSCLES.relaxed, atol=np.radians(0.05))
    pulled = np.zeros(len(MUSCLES.names))
    pulled[MUSCLES.names.index("flexor_digitorum_profundus_3")] = 0.5
    bent = DRIVE.resting(pulled, still.angles).angles - still.angles
    moved = {n for n, a in zip(MUSCLES.angles, bent, strict=True) if abs(a) > np.radians(1)}
    assert moved == {"MP3_flexion", "PIP3_flexion", "DIP3_flexion"} and bent.max() > np.radians(20)


def test_contractions_are_found_for_a_motion_and_lead_to_it():
    random = np.random.default_rng(2)
    keys = 0.3 * random.random((4, len(MUSCLES.names)))
    wave = np.concatenate(
        [np.linspace(a, b, 12, endpoint=False) for a, b in zip(keys, keys[1:], strict=False)]
    )
    wanted = angles_of_contractions(DRIVE, wave, 1 / 24).angles
    frames = [dict(zip(MUSCLES.angles, row, strict=True)) for row in wanted]
    found = contractions_of_angles(DRIVE, frames, 1 / 24)
    assert np.degrees(np.abs(found.errors)).mean() < 0.3 and np.degrees(np.abs(found.errors)).max() < 4.0
    assert (found.contractions**2).sum() < (wave**2).sum()  # other muscles do the same with less effort
    replayed = angles_of_contractions(DRIVE, found.contractions, 1 / 24).angles
    np.testing.assert_allclose(replayed, found.angles, atol=1e-9)


def test_a_table_of_contractions_is_a_motion(tmp_path):
    path = tmp_path / "bend.csv"
    path.write_text(TABLE)
    assert is_motion(path)
    motion = expand_motion(path, RIG)
    assert [*motion.frames] == motion_frame_names(path, RIG.limits) and len(motion.frames) == 19
    bend = [frame["PIP2_flexion"] for frame in motion.frames.values()]
    assert np.all(np.diff(bend[:13]) >= 0) and bend[12] - bend[0] > np.radians(20)
    assert any("flexor_carpi_ulnaris moves no joint" in sentence for sentence in motion.said)


@pytest.mark.parametrize(
    "old, new, told",
    [
        ("bent,12,0.6", "bent,12,3", "row 3 (key bent), flexor_digitorum_profundus_2: is 3"),
        ("flexor_carpi_ulnaris", "biceps", "column biceps: is no muscle"),
        ("bent,12", "bent,-1", "row 3 (key bent), time"),
        ("0.6,1", "0.6", "has 3 cells, not 4"),
        ("time [frame]", "when", "second column"),
        ("flexor_carpi_ulnaris", "flexor_digitorum_profundus_2", "more than once"),
    ],
)
def test_wrong_tables_are_refused_by_row_and_column(tmp_path, old, new, told):
    path = tmp_path / "bend.csv"
    path.write_text(TABLE.replace(old, new))
    with pytest.raises(InputError) as error:
        motion_frame_names(path, RIG.limits)
    assert told in str(error.value)


@pytest.mark.parametrize("name, moving", [("typing", "2345"), ("trill", "23")])
def test_shipped_contractions_bend_the_fingers_that_play(name, moving):
    path = ROOT / load_scene(ROOT / f"config/scenes/{name}.yaml").frames
    frames = [*expand_motion(path, RIG).frames.values()]
    for digit in "2345":
        swing = np.degrees(np.ptp([frame[f"MP{digit}_flexion"] for frame in frames]))
        assert swing > 20 if digit in moving else swing < 6


def test_the_command_writes_contractions_that_follow_keyframes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    RIG.save("rig.h5")
    Path("wave.csv").write_text(KEYS)
    assert main(["contractions", "rig.h5", "wave.csv", "made.csv"]) == 0
    assert "13 frames" in capsys.readouterr().out
    bent = [frame["PIP2_flexion"] for frame in expand_motion("made.csv", RIG).frames.values()]
    assert np.degrees(bent[-1]) == pytest.approx(50, abs=3)
