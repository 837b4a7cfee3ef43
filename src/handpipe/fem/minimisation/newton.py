"""A globalised Newton method for one minimisation."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import replace
from typing import Any

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.minimisation import rigid_modes
from handpipe.fem.minimisation.balance import Balance, lengths, rounding
from handpipe.fem.minimisation.checkpoint import Checkpoint
from handpipe.fem.minimisation.direction import Directions
from handpipe.fem.minimisation.few_vertices import few_vertices, with_neighbours
from handpipe.fem.minimisation.opening import opened
from handpipe.fem.minimisation.record import Options, Record
from handpipe.fem.minimisation.spacing import spacing
from handpipe.fem.minimisation.workspace import Workspace
from handpipe.fem.potentials.potential import Sum

log = logging.getLogger(__name__)

ARMIJO = 1e-4  # share of the predicted decrease that a step must bring
ROUNDING = 1e-13  # of the energy: differences below this are rounding
EPSILON = 1e-16  # rounding of a double
RESTING = 5  # steps in a row below the tolerance that make a shape rest
NEGLIGIBLE = 1e-3  # of a tolerance
LOOSEST, TIGHTEST = 0.01, 1e-4  # relative error of the linear solves
SPARE = 0.1  # of the forces at rest
KICK = 0.1  # of the spacing of vertices, away from a stationary point that is no minimum
MAX_ESCAPES = 5  # of one minimisation from stationary points that are no minima
MAX_RELEASES = 5  # of one minimisation: times that pinned motions are released
FLIGHT = 10.0  # of the scene's size: a body that went so far may have left for good
PROGRESS = 10.0  # s between two lines of progress
# options of a minimisation over few vertices: 30 iterations at most, they need not come to rest
ALONE: dict[str, Any] = {"coarse": None, "single": False, "enough": None, "max_iterations": 30}
HALVINGS = 40  # of a step, at most
SHORTER, LONGER = 0.1, 0.5  # share of a step that the next trial takes, at least and at most


class Newton:
    """Minimises `energy` from x (n, 3) over the unknowns of the mask `free` (3n,).

    An `impatient` one stops, with `struggling` set, where only less than half a step lowers the energy.
    """

    settles_few = True  # whether few vertices are minimised over first
    level = logging.INFO  # of the line that says the end

    def __init__(
        self,
        energy: Sum,
        x: Array,
        free: BoolArray,
        options: Options,
        workspace: Workspace,
        checkpoint: Checkpoint | None = None,
        impatient: bool = False,
    ) -> None:
        self.impatient, self.struggling = impatient, False
        self.energy, self.x, self.free, self.options = energy, x, free, options
        self.record = Record()
        self._workspace, self._checkpoint = workspace, checkpoint
        self._unknowns = free
        self._directions = Directions(energy, free, workspace, self.record)
        self._scale = self._energy_noise = 0.0
        self._start, self._extent = x, float(np.ptp(x, axis=0).max(initial=0.0))
        self._gradients: list[Array] = []
        self._releases = 0
        self._value = 0.0
        self._renewed = any(hasattr(p, "refresh") for p in energy.potentials)
        self._left: tuple[Array, float] | None = None
        self._noticed = time.perf_counter()
        self._settles = self.settles_few and not self._renewed
        self._settled = 0  # the iteration before which few vertices were minimised over

    def run(self) -> None:
        """Iterate until converged, stuck or out of iterations."""
        systems = self._workspace.systems
        before = systems.factorisations, systems.cg_iterations
        self._run()
        if not self.record.converged:
            self._returned()
        self.record.factorisations = systems.factorisations - before[0]
        self.record.cg_iterations = systems.cg_iterations - before[1]

    def _run(self) -> None:
        if not self.free.any():
            self.record.converged, self.record.reason = True, "nothing is free"
            return
        self.x = opened(self.energy, self.x, self.free, self.options.name)
        self._value = self.energy.value(self.x)
        if not np.isfinite(self._value):
            self.record.reason = "the energy at the start is not finite"
            return
        if not self._look_at_start():
            return
        while True:
            gradient = self._gradient()
            if not np.all(np.isfinite(gradient)):
                self.record.reason = "forces are not finite"
                return
            residual = self._note(gradient)
            direction = self._directions.at(self.x, gradient, self._forcing())
            if direction is None and residual > 0.0:
                self.record.reason = "the tangent stiffness cannot be factorised"
                return
            if direction is None:  # neither force nor stiffness, as with all vertices in one point
                direction = np.zeros_like(gradient)
            if self.impatient and self._directions.convexified:
                self.struggling, self.record.reason = True, "the tangent stiffness is not positive definite"
                return
            length = _largest(direction)
            if self._rests(gradient, direction):
                self._finish(direction)
                if not self._leave():
                    return
                continue
            if self._released(gradient, direction):
                continue
            if self._settle_few(direction):
                continue
            if self.record.iterations >= self.options.max_iterations:
                self.record.reason = self._why(f"{self.options.max_iterations} iterations", gradient, length)
                return
            if not self._search(direction, gradient, length):
                problem = "no step along the Newton direction lowers the energy"
                self.record.reason = self.record.reason or self._why(problem, gradient, length)
                return
            self.record.iterations += 1
            if self._flown() or self._near_enough(direction):
                return
            self._report(residual, length)
            if self._checkpoint is not None:
                self._checkpoint.save_when_due(self.x)
            if self._renewed:
                self.energy.refresh(self.x)
                self._value = self.energy.value(self.x)

    def _settle_few(self, direction: Array) -> bool:
        """Minimise over the few vertices that a step (3n,) is about, all others fixed; False where it is not.

        Not twice without a step of all vertices between.
        """
        if not self._settles or self._settled == self.record.iterations:
            return False
        stiffness = self._directions.tangent(self.x)
        few = few_vertices(direction, stiffness)
        if few is None:
            return False
        self._settled = self.record.iterations
        kept = np.flatnonzero(with_neighbours(few, stiffness))
        part = self.energy.near(few, kept)
        if part is None:
            self._settles = False
            return False
        trial = self.x.copy()
        free = self._unknowns.reshape(-1, 3)[kept] & few[kept, None]
        trial[kept] = self._at_rest(part, trial[kept], free.ravel())
        value = self.energy.value(trial)
        if not value < self._value:
            return False
        self.x, self._value = trial, value
        self.record.relaxed += 1
        return True

    def _at_rest(self, energy: Sum, x: Array, free: BoolArray) -> Array:
        """Positions (k, 3) of a few vertices and their neighbours after a minimisation of their own."""
        name = f"{self.options.name}, few vertices"
        options = replace(self.options, **ALONE, name=name)
        workspace = Workspace(x)
        workspace.constrained = True  # the fixed vertices around them leave no rigid-body mode
        newton = _OfFewVertices(energy, x, free, options, workspace)
        newton.run()
        return newton.x

    def _look_at_start(self) -> bool:
        """Compute the limits of small forces, and pin the unconstrained rigid-body modes.

        False where a load acts along one of these: there is no equilibrium.
        """
        start = time.perf_counter()
        stiffness = self._directions.tangent(self.x)
        self._balance = Balance(self.energy, stiffness, self.x, self.options.force_tolerance)
        # Each element's energy near rest is a difference of terms as large as those of a strain of one.
        force = float(self._balance.resistance.mean())
        self._energy_noise = EPSILON * force * self._spacing() * math.sqrt(len(self.x))
        pins = np.zeros(0, dtype=np.int64)
        if not self._workspace.constrained:
            self.record.reason = rigid_modes.unbalanced(self.energy, stiffness, self.x, self.free)
            pins = rigid_modes.pins(self.energy, stiffness, self.x, self.free)
            self._workspace.constrained = len(pins) == 0
        self.record.seconds["assembly"] += time.perf_counter() - start
        if len(pins):
            self._pin(pins)
        return not self.record.reason

    def _pin(self, pins: IntArray) -> None:
        """Fix some of the free degrees of freedom in place of those fixed so far."""
        log.info("%s: %d unconstrained rigid-body modes; pinning them", self.options.name, len(pins))
        unknowns = self.free.copy()
        unknowns[pins] = False
        self._set_unknowns(unknowns)

    def _released(self, gradient: Array, direction: Array) -> bool:
        """Choose new pins where pins carry forces: contact has closed, and resists a mode that was free."""
        pinned = self.free & ~self._unknowns
        if not pinned.any() or _largest(direction) > self.options.displacement_tolerance:
            return False
        reactions = lengths(np.where(pinned, gradient, 0.0))
        stiffness = self._directions.tangent(self.x)
        small = self._balance.limits(self.x, self._gradients) + rounding(stiffness, self.x)
        if self._releases == MAX_RELEASES or (reactions <= small).all():
            return False
        self._releases += 1
        self._pin(rigid_modes.pins(self.energy, stiffness, self.x, self.free))
        return True

    def _set_unknowns(self, unknowns: BoolArray) -> None:
        self._unknowns = unknowns
        self._directions = Directions(self.energy, unknowns, self._workspace, self.record)

    def _gradient(self) -> Array:
        """Gradient (3n,); those of single potentials are kept."""
        start = time.perf_counter()
        self._gradients = [p.gradient(self.x) for p in self.energy.potentials]
        self._scale = max(_largest(g) for g in self._gradients)
        self.record.seconds["assembly"] += time.perf_counter() - start
        return np.sum(self._gradients, axis=0).reshape(-1)

    def _note(self, gradient: Array) -> float:
        residual = _largest(np.where(self.free, gradient, 0.0))
        self.record.energies.append(self._value)
        self.record.residuals.append(residual)
        return residual

    def _forcing(self) -> float:
        """Relative error allowed in the linear solve, small where the residual falls fast.

        Two levels pay for each digit: no more of them than bring forces to a tenth of those at rest.
        """
        residuals = self.record.residuals
        if len(residuals) < 2 or residuals[-2] == 0.0:
            return LOOSEST
        error = 0.5 * (residuals[-1] / residuals[-2]) ** 2
        if self.options.coarse is not None and residuals[-1] > 0.0:
            error = max(error, SPARE * self.options.force_tolerance * self._scale / residuals[-1])
        return float(np.clip(error, TIGHTEST, LOOSEST))

    def _rests(self, gradient: Array, direction: Array) -> bool:
        """Whether x is an equilibrium, for the gradient (3n,) and the Newton direction (3n,) there.

        Along a mode without stiffness a step may be long although the force along it is rounding.
        """
        residuals, steps = self._unbalanced(gradient), lengths(direction)
        tolerance = self.options.displacement_tolerance
        stiffness = self._directions.tangent(self.x)
        rounded = residuals <= rounding(stiffness, self.x)
        if steps.max() > tolerance and not self._oscillates():
            return bool(rounded.all())
        small = self._balance.limits(self.x, self._gradients)
        within = residuals <= small
        if within.all() or (rounded | within).all() and steps.max() > tolerance:
            return True
        # Where rounding hides the forces, a step that balances them must be negligible.
        left = lengths(np.where(self.free, gradient + stiffness @ direction, 0.0))
        hidden = rounded & (left <= small) & (steps <= NEGLIGIBLE * tolerance)
        return bool((within | hidden).all())

    def _oscillates(self) -> bool:
        """Whether the last steps were small: at a kink of contact Newton's method oscillates."""
        recent = self.record.steps[-RESTING:]
        return len(recent) == RESTING and max(recent) <= self.options.displacement_tolerance

    def _unbalanced(self, gradient: Array) -> Array:
        """Unbalanced force (n,) on the free degrees of freedom of each vertex."""
        return lengths(np.where(self.free, gradient.reshape(-1), 0.0))

    def _finish(self, direction: Array) -> None:
        """Take the last step too, where it brings forces down: its energy is often lost in rounding."""
        trial = self.x + direction.reshape(self.x.shape)
        if self.energy.max_step(self.x, trial - self.x) == 1.0:
            value = self.energy.value(trial)
            after = self._unbalanced(self.energy.gradient(trial))
            before = self._unbalanced(np.sum(self._gradients, axis=0))
            small = self._balance.limits(self.x, self._gradients)
            better = after.max() < before.max() and bool((after <= np.maximum(before, small)).all())
            if np.isfinite(value) and better:
                self.x, self._value = trial, value
                self.record.residuals[-1] = float(after.max())
        self.record.converged, self.record.reason = True, "converged"
        log.log(
            self.level,
            "%s: converged in %d iterations, residual %.2e mN of %.2e mN",
            self.options.name,
            self.record.iterations,
            self.record.residuals[-1],
            self._scale,
        )

    def _why(self, problem: str, gradient: Array, length: float) -> str:
        """Why the solve has not converged: a body that slides away, rounding, or unbalanced forces."""
        drift = rigid_modes.drifting(self.energy, self.x, self._start, self.free)
        if drift:
            return f"{drift} ({problem})"
        residuals = self._unbalanced(gradient)
        small = self._balance.limits(self.x, self._gradients)
        worst = int(np.argmax(residuals - small))
        text = (
            f"{problem}, unbalanced force {residuals[worst]:.3g} mN of {small[worst]:.3g} mN allowed "
            f"on vertex {worst}, next step {length:.3g} mm"
        )
        noise = rounding(self._directions.tangent(self.x), self.x)[worst]
        if residuals[worst] <= noise:
            text += f"; stiff springs or contact there round forces by {noise:.2g} mN"
        return text

    def _near_enough(self, direction: Array) -> bool:
        """Whether `options.enough` accepts x, to which a step (3n,) or a part of it has led."""
        enough = self.options.enough
        if enough is None or not enough(self.x, direction.reshape(self.x.shape)):
            return False
        self.record.converged, self.record.reason = True, "near enough"
        count, residual = self.record.iterations, self.record.residuals[-1]
        text = "%s: near enough in %d iterations, residual %.2e mN before the last"
        log.log(self.level, text, self.options.name, count, residual)
        return True

    def _flown(self) -> bool:
        """Whether some body has moved away for good, since no potential resists its load."""
        if _largest(self.x - self._start) < FLIGHT * self._extent:
            return False
        self.record.reason = rigid_modes.drifting(self.energy, self.x, self._start, self.free)
        return bool(self.record.reason)

    def _leave(self) -> bool:
        """Leave a stationary point that is no minimum; False where it is one or where that failed."""
        if self._returned():
            return False
        if self.options.saddles or not self._directions.convexified or self.record.escapes >= MAX_ESCAPES:
            return False
        kick = self._soft_motion(self.record.escapes)
        if kick is None:
            return False
        self._left = self.x, self._value
        self.record.escapes += 1
        self.record.converged = False
        kick *= self.energy.max_step(self.x, kick)
        while not np.isfinite(self.energy.value(self.x + kick)):
            kick *= 0.5
        self.x = self.x + kick
        self._value = self.energy.value(self.x)
        log.info("%s: a stationary point that is no minimum; continuing nearby", self.options.name)
        return True

    def _soft_motion(self, seed: int) -> Array | None:
        """Displacements (n, 3) under random forces, scaled to a tenth of the spacing; None at a minimum.

        Forces move soft parts, and small elements as a whole: random motions of vertices would invert these.
        Without any stiffness the forces themselves serve as motions.
        """
        forces = np.where(self._unknowns, np.random.default_rng(seed).normal(size=self.x.size), 0.0)
        motion = self._directions.at(self.x, forces, LOOSEST, anew=True)
        if not self._directions.convexified:
            return None
        motion = forces if motion is None else motion
        return (KICK * self._spacing() / _largest(motion) * motion).reshape(self.x.shape)

    def _returned(self) -> bool:
        """Go back to the stationary point that was left, if one was and this energy is no lower."""
        if self._left is None:
            return False
        x, value = self._left
        if self._value < value - 1e-9 * max(abs(value), self._scale * self._spacing()):
            return False
        self.x, self._value = x, value
        self.record.converged, self.record.reason = True, "converged"
        return True

    def _spacing(self) -> float:
        """Mean distance of vertices in mm, from the box that they fill at rest."""
        shapes = [p.vertices for p in self.energy.potentials if hasattr(p, "vertices")]
        return spacing(shapes[0] if shapes else self.x)

    def _search(self, direction: Array, gradient: Array, length: float) -> bool:
        """Step along the direction with sufficient decrease; False where there is none."""
        start = time.perf_counter()
        step = direction.reshape(self.x.shape)
        slope = float(gradient @ direction)
        alpha = min(1.0, self.options.max_step / max(length, 1e-300))
        alpha = min(alpha, self.energy.max_step(self.x, alpha * step) * alpha)
        allowed = alpha
        noise = self._rounding(length)
        for _ in range(HALVINGS):
            trial = self.x + alpha * step
            value = self.energy.value(trial)
            if np.isfinite(value) and value <= self._value + ARMIJO * alpha * slope + noise:
                if self._directions.convexified and alpha == 1.0:
                    trial, value, alpha = self._stretch(step, trial, value)
                self.x, self._value = trial, value
                self.record.steps.append(alpha * length)
                self.record.seconds["search"] += time.perf_counter() - start
                return True
            alpha *= _backtrack(alpha, slope, value - self._value)
            if self.impatient and alpha < 0.5 * allowed:
                self.struggling, self.record.reason = True, "energy allows only short steps"
                return False
        self.record.seconds["search"] += time.perf_counter() - start
        return False

    def _rounding(self, length: float) -> float:
        """Differences of energy, over a step of this length, that are rounding."""
        return ROUNDING * (abs(self._value) + self._scale * length) + self._energy_noise

    def _stretch(self, step: Array, trial: Array, value: float) -> tuple[Array, float, float]:
        """Double an accepted step while the energy decreases: a convexified Hessian is too stiff."""
        alpha = 1.0
        for _ in range(5):
            if 2 * alpha * _largest(step) > self.options.max_step:
                break
            if self.energy.max_step(self.x, 2 * alpha * step) < 1.0:
                break
            further = self.x + 2 * alpha * step
            lower = self.energy.value(further)
            if not lower < value:
                break
            trial, value, alpha = further, lower, 2 * alpha
        return trial, value, alpha

    def _report(self, residual: float, length: float) -> None:
        log.debug(
            "%s: %d: energy %.8g uJ, residual %.2e mN, step %.2e of %.2e mm",
            self.options.name,
            self.record.iterations,
            self._value,
            residual,
            self.record.steps[-1],
            length,
        )
        now = time.perf_counter()
        if now - self._noticed > PROGRESS:
            self._noticed = now
            log.info(
                "%s: %d iterations, residual %.2e of %.2e mN, step %.2e mm",
                self.options.name,
                self.record.iterations,
                residual,
                self.options.force_tolerance * self._scale,
                length,
            )


class _OfFewVertices(Newton):
    """A minimisation over few vertices, as a part of another one."""

    settles_few = False
    level = logging.DEBUG


def _largest(vector: Array) -> float:
    """Largest norm over vertices of a vector (3n,) or (n, 3)."""
    return float(np.sqrt((vector.reshape(-1, 3) ** 2).sum(axis=1).max()))


def _backtrack(alpha: float, slope: float, rise: float) -> float:
    """Factor on alpha from the parabola through the trial, kept within bounds."""
    if not np.isfinite(rise):
        return 0.25
    return float(np.clip(-slope * alpha / (2.0 * (rise - slope * alpha)), SHORTER, LONGER))
