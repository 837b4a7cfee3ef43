"""Static equilibria: a globalised Newton method on a sum of potentials, and continuation in a load."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from handpipe.errors import ConvergenceError, InputError
from handpipe.fem.linear import Factor, NotPositiveDefinite, SingularMatrix, factorise
from handpipe.fem.potential import Potential, Sum, same_pattern
from handpipe.fem.reduction import FreeBlock

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
log = logging.getLogger(__name__)

ARMIJO = 1e-4  # share of the predicted decrease that a step must bring
ROUNDING = 1e-13  # of the energy: differences below this say nothing
LEAST_BLEND = 1 / 16  # smaller shares of the projected Hessian are not tried
RESTING = 5  # steps in a row below the tolerance that make a shape rest
CG_TOLERANCE = 1e-3
CG_ITERATIONS_PER_FACTORISATION = 36.0  # at 136,000 unknowns; the ratio grows as their number to 2/3
CG_LEAST_UNKNOWNS = 40_000  # below, a factorisation costs about ten iterations


@dataclass(frozen=True)
class Options:
    """When to stop, and what to do where that fails.

    Converged: the last Newton step moves no vertex by more than `displacement_tolerance` mm and the largest
    residual force is below `force_tolerance` times the characteristic force (or below a thousandth of that,
    however long the step), the largest force that any
    potential puts on a vertex. `allow_partial`: hand back the best state instead of raising.
    """

    displacement_tolerance: float = 1e-4
    force_tolerance: float = 1e-5
    max_iterations: int = 100
    max_step: float = np.inf
    allow_partial: bool = False
    name: str = "equilibrium"


@dataclass
class Record:
    """What a solve did: residuals are largest vertex forces in mN, one an iteration; seconds by work."""

    converged: bool = False
    reason: str = ""
    iterations: int = 0
    factorisations: int = 0
    projections: int = 0
    cg_iterations: int = 0
    energies: list[float] = field(default_factory=list)
    residuals: list[float] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=lambda: {"assembly": 0.0, "linear": 0.0, "search": 0.0})


@dataclass(frozen=True)
class Equilibrium:
    """Positions x (n, 3) in mm and the record of how they were found."""

    x: Array
    record: Record


def solve(
    potentials: Sequence[Potential],
    x: Array,
    *,
    fixed: NDArray | None = None,
    options: Options | None = None,
) -> Equilibrium:
    """Minimise the sum of potentials from x (n, 3); `fixed` degrees of freedom keep their values in x.

    `fixed` is a mask (3n,) or (n, 3), or indices of degrees of freedom. Fix vertices where they should end
    and let `continuation` take large moves in steps. A body that nothing holds needs `nullspace.rigid_pins`.
    Raises `ConvergenceError`, unless `options.allow_partial`.
    """
    options = options or Options()
    newton = _Newton(Sum(potentials), np.array(x, dtype=float), _free(fixed, x.size), options)
    newton.run()
    if not newton.record.converged and not options.allow_partial:
        raise ConvergenceError(options.name, newton.record.reason)
    return Equilibrium(newton.x, newton.record)


def continuation(
    make_potentials: Callable[[float], Sequence[Potential]],
    x: Array,
    *,
    fixed: NDArray | None = None,
    prescribed: Callable[[float], Array] | None = None,
    options: Options | None = None,
    first_step: float = 0.25,
    smallest_step: float = 1 / 256,
) -> Equilibrium:
    """Follow the equilibrium from t = 0 to 1, where x (n, 3) is (near) the equilibrium at t = 0.

    `make_potentials(t)` gives the potentials; `prescribed(t)` (n, 3) the positions, of which the `fixed`
    degrees of freedom are taken. Each step starts from a prediction with the tangent at hand; a step that
    fails is halved, one that converges easily is doubled. Raises `ConvergenceError` below `smallest_step`.
    """
    options = options or Options()
    strict = replace(options, allow_partial=False)
    free = _free(fixed, x.size)
    x = np.array(x, dtype=float)
    t, step, record = 0.0, first_step, Record()
    while t < 1.0:
        step = min(step, 1.0 - t)
        try:
            potentials = make_potentials(t + step)
            target = x if prescribed is None else prescribed(t + step)
            start = _predict(Sum(potentials), x, target, free)
            found = solve(potentials, start, fixed=~free, options=strict)
        except ConvergenceError as error:
            log.info("%s: t = %.4f failed (%s), halving", options.name, t + step, error)
            step *= 0.5
            if step < smallest_step:
                if options.allow_partial:
                    record.reason = f"stopped at t = {t:.4f}: {error}"
                    return Equilibrium(x, record)
                reason = f"no equilibrium beyond t = {t:.4f}; last attempt: {error}"
                raise ConvergenceError(options.name, reason) from error
            continue
        t, x = t + step, found.x
        _accumulate(record, found.record)
        log.info("%s: t = %.4f after %d iterations", options.name, t, found.record.iterations)
        if found.record.iterations <= 6:
            step *= 2.0
    return Equilibrium(x, record)


def _free(fixed: NDArray | None, size: int) -> NDArray[np.bool_]:
    """Mask (3n,) of the unknowns."""
    free = np.ones(size, dtype=bool)
    if fixed is None:
        return free
    array = np.asarray(fixed)
    if array.dtype == bool:
        if array.size != size:
            raise InputError(
                "equilibrium", "fixed", f"has {array.size} entries, not {size}", "Give a mask (3n,)"
            )
        return ~array.ravel()
    free[array.ravel()] = False
    return free


def _predict(energy: Sum, x: Array, target: Array, free: NDArray[np.bool_]) -> Array:
    """Move the fixed vertices to the target and the others with them, by one linear solve at x."""
    start = x.copy()
    flat, aim = start.reshape(-1), target.reshape(-1)
    moved = np.where(free, 0.0, aim - flat)
    flat[~free] = aim[~free]
    if not moved.any():
        return start
    matrix = energy.hessian(x, True)
    block = FreeBlock(matrix, free)
    try:
        change = factorise(block.matrix(matrix)).solve(-(matrix @ moved)[free])
    except (NotPositiveDefinite, SingularMatrix):
        return start
    flat[free] += change
    return start


def _accumulate(total: Record, part: Record) -> None:
    total.converged, total.reason = part.converged, part.reason
    for name in ("iterations", "factorisations", "projections", "cg_iterations"):
        setattr(total, name, getattr(total, name) + getattr(part, name))
    for name in ("energies", "residuals", "steps"):
        getattr(total, name).extend(getattr(part, name))
    for name, seconds in part.seconds.items():
        total.seconds[name] += seconds


class _Newton:
    """One solve: the state, and the steps of the method as short functions of it."""

    def __init__(self, energy: Sum, x: Array, free: NDArray[np.bool_], options: Options) -> None:
        self.energy, self.x, self.free, self.options = energy, x, free, options
        self.record = Record()
        self._block: FreeBlock | None = None
        self._factor: Factor | None = None
        self._factor_holds = False
        self._cg_spent = 0
        self._blend = 0.0
        self._convexified = False
        self._scale = 0.0
        self._value = 0.0

    def run(self) -> None:
        """Iterate until converged, stuck or out of iterations."""
        if not self.free.any():
            self.record.converged, self.record.reason = True, "nothing is free"
            return
        self._value = self._timed("search", lambda: self.energy.value(self.x))
        for _ in range(self.options.max_iterations):
            gradient = self._timed("assembly", self._gradient)
            if not np.all(np.isfinite(gradient)) or not np.isfinite(self._value):
                self.record.reason = "energy or forces are not finite"
                return
            residual = _largest(np.where(self.free, gradient, 0.0))
            self.record.energies.append(self._value)
            self.record.residuals.append(residual)
            direction = self._direction(gradient)
            if direction is None:
                self.record.reason = "the tangent stiffness cannot be factorised"
                return
            length = _largest(direction)
            if self._converged(residual, length):
                self._finish(direction)
                return
            if not self._search(direction, gradient, length):
                return
            self.record.iterations += 1
            self.energy.refresh(self.x)
        self.record.reason = (
            f"{self.options.max_iterations} iterations, residual {self.record.residuals[-1]:.3g} mN "
            f"of {self._scale:.3g} mN, last step {self.record.steps[-1]:.3g} mm"
        )

    def _gradient(self) -> Array:
        """Gradient (3n,); the characteristic force is renewed on the way."""
        parts = [p.gradient(self.x) for p in self.energy.potentials]
        self._scale = max([self._scale, *(_largest(p) for p in parts)])
        return np.sum(parts, axis=0).reshape(-1)

    def _converged(self, residual: float, length: float) -> bool:
        tolerance = self.options.displacement_tolerance
        if length > tolerance:
            recent = self.record.steps[-RESTING:]
            if len(recent) == RESTING and max(recent) <= tolerance:
                # At a kink of contact Newton's step overshoots for ever; the shape rests all the same.
                return residual <= self.options.force_tolerance * self._scale
            # Along a mode without stiffness a step has length but next to no force behind it.
            return residual <= 1e-3 * self.options.force_tolerance * self._scale
        # A step of a thousandth of the tolerance is rounding, whatever the scale of the forces.
        return residual <= self.options.force_tolerance * self._scale or length <= 1e-3 * tolerance

    def _finish(self, direction: Array) -> None:
        trial = self.x + direction.reshape(self.x.shape)
        if self.energy.max_step(self.x, trial - self.x) == 1.0 and self.energy.value(trial) <= self._value:
            self.x = trial
        self.record.converged, self.record.reason = True, "converged"
        log.info(
            "%s: converged in %d iterations, residual %.2e mN of %.2e mN",
            self.options.name,
            self.record.iterations,
            self.record.residuals[-1],
            self._scale,
        )

    def _direction(self, gradient: Array) -> Array | None:
        """Newton direction (3n,), of the plain Hessian where it is positive definite, else of a stand-in."""
        matrix = self._timed("assembly", lambda: self._reduced(project=False))
        force = -gradient[self.free]
        solution = None
        if self._blend < LEAST_BLEND:
            solution = self._timed("linear", lambda: self._by_stale_factor(matrix, force))
            if solution is None:
                solution = self._timed("linear", lambda: self._by_factor(matrix, force))
        self._convexified = solution is None
        if solution is None:
            self.record.projections += 1
            projected = self._timed("assembly", lambda: self._reduced(project=True))
            solution = self._timed("linear", lambda: self._by_blend(matrix, projected, force))
        if solution is None:
            return None
        direction = np.zeros(self.x.size)
        direction[self.free] = solution
        return direction

    def _reduced(self, project: bool) -> sp.csr_matrix:
        matrix = self.energy.hessian(self.x, project)
        if self._block is None or not same_pattern(self._block.source, matrix):
            self._block = FreeBlock(matrix, self.free)
        return self._block.matrix(matrix)

    def _by_factor(self, matrix: sp.csr_matrix, force: Array) -> Array | None:
        """Direct solve; None where the matrix is not positive definite."""
        try:
            if self._factor is None:
                self._factor = factorise(matrix, positive=True)
            else:
                self._factor.refactorise(matrix)
        except NotPositiveDefinite:
            self._factor_holds = False  # its symbolic analysis still serves
            return None
        finally:
            self.record.factorisations += 1
        self._cg_spent, self._factor_holds = 0, True
        return self._factor.solve(force)

    def _by_blend(self, plain: sp.csr_matrix, projected: sp.csr_matrix, force: Array) -> Array | None:
        """Direct solve with about the least share of the projected Hessian that makes it definite.

        The projected Hessian alone is far too stiff near a saddle: it creeps. The search starts at the share
        that served last, and a quarter of what serves now is tried next.
        """
        share = max(self._blend, LEAST_BLEND)
        while share < 1.0:
            mixed = plain.copy()
            mixed.data += share * (projected.data - plain.data)
            solution = self._by_factor(mixed, force)
            if solution is not None:
                self._blend = 0.25 * share
                return solution
            share *= 4.0
        self._blend = 0.25
        return self._by_shift(projected, force)

    def _by_shift(self, matrix: sp.csr_matrix, force: Array) -> Array | None:
        """Direct solve with the least of a few growing multiples of the identity that makes it possible."""
        mean = float(np.abs(matrix.diagonal()).mean())
        for shift in (0.0, 1e-8, 1e-5, 1e-2, 1.0):
            shifted = matrix if shift == 0.0 else _add_diagonal(matrix, shift * mean)
            solution = self._by_factor(shifted, force)
            if solution is not None and np.all(np.isfinite(solution)):
                return solution
        return None

    def _by_stale_factor(self, matrix: sp.csr_matrix, force: Array) -> Array | None:
        """Conjugate gradients preconditioned by an earlier factor, while that is cheaper than a new one."""
        unknowns = len(force)
        if self._factor is None or not self._factor_holds or unknowns < CG_LEAST_UNKNOWNS:
            return None
        budget = int(CG_ITERATIONS_PER_FACTORISATION * (unknowns / 136e3) ** (2 / 3)) - self._cg_spent
        solution, iterations = _conjugate_gradients(matrix, force, self._factor, budget)
        self._cg_spent += iterations
        self.record.cg_iterations += iterations
        return solution

    def _search(self, direction: Array, gradient: Array, length: float) -> bool:
        """Step along the direction with sufficient decrease; False where there is none."""
        start = time.perf_counter()
        step = direction.reshape(self.x.shape)
        slope = float(gradient @ direction)
        alpha = min(1.0, self.options.max_step / max(length, 1e-300))
        alpha = min(alpha, self.energy.max_step(self.x, alpha * step) * alpha)
        noise = ROUNDING * (abs(self._value) + self._scale * length)
        for _ in range(40):
            trial = self.x + alpha * step
            value = self.energy.value(trial)
            if np.isfinite(value) and value <= self._value + ARMIJO * alpha * slope + noise:
                if self._convexified and alpha == 1.0:
                    trial, value, alpha = self._stretch(step, trial, value)
                self.x, self._value = trial, value
                self.record.steps.append(alpha * length)
                self.record.seconds["search"] += time.perf_counter() - start
                log.debug(
                    "%s: energy %.8g, residual %.2e mN, step %.2e mm x %.2g",
                    self.options.name,
                    value,
                    self.record.residuals[-1],
                    length,
                    alpha,
                )
                return True
            alpha *= _backtrack(alpha, slope, value - self._value)
        self.record.seconds["search"] += time.perf_counter() - start
        self.record.reason = (
            f"no step along the Newton direction lowers the energy; residual "
            f"{self.record.residuals[-1]:.3g} mN of {self._scale:.3g} mN, Newton step {length:.3g} mm"
        )
        return False

    def _stretch(self, step: Array, trial: Array, value: float) -> tuple[Array, float, float]:
        """Double an accepted step while the energy goes on falling: a convexified Hessian is too stiff."""
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

    def _timed(self, kind: str, work: Callable):  # type: ignore[no-untyped-def, type-arg]
        start = time.perf_counter()
        result = work()
        self.record.seconds[kind] += time.perf_counter() - start
        return result


def _largest(vector: Array) -> float:
    """Largest norm over vertices of a vector (3n,) or (n, 3)."""
    return float(np.sqrt((vector.reshape(-1, 3) ** 2).sum(axis=1).max()))


def _backtrack(alpha: float, slope: float, rise: float) -> float:
    """Factor on alpha from the parabola through the trial, kept within [0.1, 0.5]."""
    if not np.isfinite(rise):
        return 0.25
    return float(np.clip(-slope * alpha / (2.0 * (rise - slope * alpha)), 0.1, 0.5))


def _add_diagonal(matrix: sp.csr_matrix, shift: float) -> sp.csr_matrix:
    """Matrix plus a multiple of the identity, in the same pattern (which holds the diagonal)."""
    shifted = matrix.copy()
    shifted.setdiag(matrix.diagonal() + shift)
    return shifted


def _conjugate_gradients(
    matrix: sp.csr_matrix, b: Array, preconditioner: Factor, budget: int
) -> tuple[Array | None, int]:
    """Solution, or None on negative curvature or after `budget` iterations; and their number."""
    u, r = np.zeros_like(b), b.copy()
    z = preconditioner.solve(r)
    p, rz = z.copy(), float(r @ z)
    target = CG_TOLERANCE**2 * rz
    for iteration in range(1, budget + 1):
        ap = matrix @ p
        curvature = float(p @ ap)
        if curvature <= 0.0:
            return None, iteration
        step = rz / curvature
        u += step * p
        r -= step * ap
        z = preconditioner.solve(r)
        new = float(r @ z)
        if new <= target:
            return u, iteration
        p = z + (new / rz) * p
        rz = new
    return None, max(budget, 0)
