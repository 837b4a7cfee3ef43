"""A sequence of nearby positive definite systems, as Newton's method makes them, solved with least work."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import psutil
import scipy.sparse as sp
from numpy.typing import NDArray

from handpipe.core import Array, BoolArray, InputError
from handpipe.fem.linear.conjugate_gradients import End, Iterations, conjugate_gradients, norm
from handpipe.fem.linear.factor import Factor, FactorTooLarge, NotPositiveDefinite, SingularMatrix
from handpipe.fem.linear.factorisation import unfactorised
from handpipe.fem.linear.multigrid import Multigrid
from handpipe.fem.linear.two_level import TwoLevel

log = logging.getLogger(__name__)

LEAST_SAVING = 12.0  # where a factorisation costs fewer iterations than this, always factorise
MULTIGRID_SETUP = 10.0  # cost of a hierarchy in iterations; measured by benchmarks/fem/linear.py
MULTIGRID_MOST = 500  # iterations
POLISHING = 20  # iterations after a direct solve that is not accurate enough
LOOSE = 0.1  # a relative residual above is not handed on
ILL = "the matrix is singular or too badly conditioned"
MEMORY_SHARE = 0.5  # of the free memory
LEAST_DIGITS = 0.3  # that a solve is taken to bring


@dataclass
class LinearWork:
    """Work done so far: counts, and seconds by kind; `factor_bytes` is the largest predicted peak."""

    factorisations: int = 0
    cg_iterations: int = 0
    multigrid_setups: int = 0
    factor_bytes: float = 0.0
    seconds: dict[str, float] = field(default_factory=lambda: {"factorise": 0.0, "solve": 0.0})


class Ageing:
    """Whether an old preconditioner still pays, all costs in CG iterations.

    A new one costs `price`, and `fresh` iterations for each decimal digit of tolerance (none for a factor,
    which solves); `spent` are those of the first system. Old ones get slower, so the mean cost of a solve,
    (price + iterations so far) / solves so far, falls until the next solve would cost more than that mean:
    then it is time for a new one.
    """

    def __init__(self, price: float, fresh: float = 0.0, spent: float = 0.0) -> None:
        self.price, self.fresh, self.spent, self.solves = price, fresh, spent, 1
        self._rates = [fresh] if fresh else []

    def worn(self, tolerance: float) -> bool:
        """Whether the next solve is expected to cost more than the mean."""
        if not self._rates:
            return False
        growth = self._rates[-1] - self._rates[-2] if len(self._rates) > 1 else 0.0
        expected = (self._rates[-1] + max(growth, 0.0)) * _digits(tolerance)
        return expected > (self.price + self.spent) / self.solves

    def most(self, tolerance: float) -> int:
        """Iterations for which a new one would solve the system as well."""
        return int(self.price + self.fresh * _digits(tolerance)) + 1

    def used(self, iterations: int, tolerance: float) -> None:
        """Take note of a solve."""
        self.spent += iterations
        self.solves += 1
        self._rates.append(iterations / _digits(tolerance))


class SystemSequence:
    """Solves A_k x = b_k for matrices of the same unknowns, of which each is near the one before.

    A factor is kept. While it is cheaper, a later system is solved by conjugate gradients preconditioned by
    that old factor, to the requested tolerance; else its own matrix is factorised. The costs compared are the
    predictions of the symbolic analysis (flops against entries of the factor, by a ratio measured once), not
    measured seconds: the same systems take the same path in every run, so results can be repeated to the last
    bit with the same number of threads. Measured seconds would gain little: a wrong ratio costs at most about
    a factorisation for each one made. `by_clock=True` compares measured seconds instead.

    Where the factor would exceed `memory_limit` bytes, multigrid preconditions instead; it needs the rest
    positions `rest` (n, 3) for their rigid modes. The default limit is a share of the free memory, the only
    choice here that depends on the machine's state: set it where results must agree to the last bit. With
    `coarse` (n, c), the prolongation of `TwoLevel`, two levels precondition from the beginning.

    With `single`, factors are in single precision, and conjugate gradients refine each solution to its
    tolerance. From the first matrix on that is indefinite in single precision alone, or whose solution cannot
    be refined, they are in double precision.
    """

    def __init__(
        self,
        *,
        memory_limit: float | None = None,
        rest: Array | None = None,
        coarse: sp.csr_matrix | None = None,
        by_clock: bool = False,
        single: bool = False,
    ) -> None:
        self.work = LinearWork()
        self.residual = 0.0  # |b - A x| / |b| of the last solution
        self._limit = _default_limit() if memory_limit is None else memory_limit
        self._rest, self._coarse, self._by_clock, self._single = rest, coarse, by_clock, single
        self._factor: Factor | None = None
        self._exact: Factor | None = None  # in double precision, for matrices that seem indefinite in single
        self._precondition: Callable[[Array], Array] = np.copy
        self._too_large = coarse is not None
        self._ageing: Ageing | None = None  # None: there is no preconditioner
        self._free = np.zeros(0, dtype=bool)

    def analysed_by(self, earlier: SystemSequence) -> None:
        """Take over the symbolic analyses of an earlier sequence, which ends, and nothing else of it.

        A factor of the same pattern has the same bits with a kept analysis as with a new one.
        """
        if earlier._single == self._single:
            self._factor = earlier._factor
        self._exact = earlier._exact
        earlier._factor = earlier._exact = earlier._ageing = None

    @property
    def factorisations(self) -> int:
        """Number of factorisations so far."""
        return self.work.factorisations

    @property
    def cg_iterations(self) -> int:
        """Number of conjugate gradient iterations so far, over all systems."""
        return self.work.cg_iterations

    def solve(
        self, matrix: sp.csr_matrix, b: Array, *, tolerance: float = 1e-3, free: NDArray | None = None
    ) -> Array:
        """Solution x (N,) with |b - A x| <= tolerance |b|.

        A (N, N) is the symmetric CSR block of the unknowns, `matrix`. `free` is a mask (3n,) or the indices
        of the unknowns; by default N = 3n. Raises `NotPositiveDefinite` where a factorisation or a direction
        of negative curvature shows it (conjugate gradients may converge without meeting one: then x is a
        direction of descent all the same), `SingularMatrix` where there is no solution or none to a tenth.
        With a coarse space, x is the iterate before such a direction.
        """
        self._meet(matrix, free)
        b = np.asarray(b, dtype=float)
        if self._ageing is not None and not self._ageing.worn(tolerance):
            solution = self._by_old(matrix, b, tolerance)
            if solution is not None:
                return solution
        if not self._too_large:
            try:
                return self._by_new_factor(matrix, b, tolerance)
            except FactorTooLarge as error:
                log.info("multigrid instead of a factor: %s", error)
                self._too_large, self._factor = True, None
        return self._by_new_levels(matrix, b, tolerance)

    def _meet(self, matrix: sp.csr_matrix, free: NDArray | None) -> None:
        """Forget preconditioners of other unknowns; an old one of another pattern still serves."""
        mask = _mask(free, matrix.shape[0], 0 if self._rest is None else self._rest.size)
        if not np.array_equal(mask, self._free):
            self._free, self._ageing, self._too_large = mask, None, self._coarse is not None

    def _by_old(self, matrix: sp.csr_matrix, b: Array, tolerance: float) -> Array | None:
        """Solution by the preconditioner at hand, None where it is too slow or a new one as cheap."""
        ageing = self._ageing
        assert ageing is not None
        if not self._too_large and ageing.price < LEAST_SAVING:
            return None
        found = self._iterate(matrix, b, tolerance, ageing.most(tolerance), foretell=True)
        if found.end is not End.CONVERGED:
            ageing.spent += found.count
            return None
        ageing.used(found.count, tolerance)
        self.residual = found.residual
        return found.x

    def _by_new_factor(self, matrix: sp.csr_matrix, b: Array, tolerance: float) -> Array:
        self._ageing = None
        start = time.perf_counter()
        try:
            factor = self._factor = self._renewed(matrix)
        except (NotPositiveDefinite, SingularMatrix):
            self.work.factorisations += 1
            raise
        finally:
            factor_seconds = time.perf_counter() - start
            self.work.seconds["factorise"] += factor_seconds
        self.work.factorisations += 1
        predicted = factor.work
        self.work.factor_bytes = max(self.work.factor_bytes, predicted.bytes)
        start = time.perf_counter()
        x = factor.solve(b)
        self.residual = _residual(matrix, x, b)
        # One refinement of a single factor brings most of the digits of double precision.
        if self._single or self.residual > tolerance:
            x += factor.solve(b - matrix @ x)
            self.residual = _residual(matrix, x, b)
        solve_seconds = time.perf_counter() - start
        self.work.seconds["solve"] += solve_seconds
        self._precondition = factor.solve
        self._ageing = Ageing(factor_seconds / solve_seconds if self._by_clock else predicted.price)
        if self.residual <= tolerance:
            return x
        found = self._iterate(matrix, b, tolerance, POLISHING)
        if self._single and found.end is not End.CONVERGED:
            self._be_double("a system is too badly conditioned for")
            return self._by_new_factor(matrix, b, tolerance)
        return self._hand_on(found, tolerance)

    def _renewed(self, matrix: sp.csr_matrix) -> Factor:
        """The factor at hand, of another matrix, or a first one."""
        if self._factor is None:
            self._factor = unfactorised(True, self._limit, self._single)
        try:
            self._factor.refactorise(matrix)
            return self._factor
        except NotPositiveDefinite:
            if not self._single:
                raise
        self.work.factorisations += 1
        if self._exact is None:
            self._exact = unfactorised(True, self._limit)
        self._exact.refactorise(matrix)  # raises where the matrix is indefinite indeed
        found = self._exact
        self._be_double("a matrix seems indefinite in")
        self._factor = found
        return found

    def _be_double(self, reason: str) -> None:
        """Forget the factor in single precision; all later ones are in double precision."""
        log.info("%s single precision: factors are in double precision from here on", reason)
        self._single, self._factor, self._exact = False, None, None

    def _by_new_levels(self, matrix: sp.csr_matrix, b: Array, tolerance: float) -> Array:
        if self._rest is None:
            raise InputError("system sequence", "rest", "is missing", "Multigrid needs the rest positions")
        self._ageing = None
        start = time.perf_counter()
        if self._coarse is None:
            self._precondition = Multigrid(matrix, self._free, self._rest)
        else:
            self._precondition = TwoLevel(matrix, self._free, self._coarse)
        self.work.multigrid_setups += 1
        self.work.seconds["factorise"] += time.perf_counter() - start
        found = self._iterate(matrix, b, tolerance, MULTIGRID_MOST)
        self._ageing = Ageing(MULTIGRID_SETUP, found.count / _digits(tolerance), found.count)
        return self._hand_on(found, tolerance)

    def _iterate(
        self, matrix: sp.csr_matrix, b: Array, tolerance: float, most: int, foretell: bool = False
    ) -> Iterations:
        """Conjugate gradients with the preconditioner at hand; raises where the matrix curves down."""
        start = time.perf_counter()
        found = conjugate_gradients(matrix, b, self._precondition, tolerance, most, foretell)
        self.work.seconds["solve"] += time.perf_counter() - start
        self.work.cg_iterations += found.count
        if found.end is End.NEGATIVE_CURVATURE and self._coarse is not None and found.count > 1:
            return found  # the directions before it are of descent (Steihaug 1983)
        if found.end is End.NEGATIVE_CURVATURE:
            raise NotPositiveDefinite("conjugate gradients met a direction of negative curvature")
        return found

    def _hand_on(self, found: Iterations, tolerance: float) -> Array:
        """The last attempt at a system, unless it is too loose to be of use."""
        self.residual = found.residual
        if found.end is End.INDEFINITE_PRECONDITIONER:
            self._ageing = None
            raise NotPositiveDefinite("multigrid of the matrix is not positive definite")
        if found.end is End.NEGATIVE_CURVATURE:
            return found.x
        if not found.residual <= LOOSE:
            self._ageing = None
            raise SingularMatrix(f"{len(found.x)} unknowns: relative residual {found.residual:.1e}, {ILL}")
        if found.end is not End.CONVERGED:
            log.warning(
                "linear solve stopped at a relative residual of %.1e, tolerance %.1e; its result is used",
                found.residual,
                tolerance,
            )
        return found.x


def _mask(free: NDArray | None, size: int, total: int) -> BoolArray:
    """Mask (3n,) of the unknowns; where `total` = 3n is not known, as far as indices reach."""
    if free is None:
        return np.ones(size, dtype=bool)
    free = np.asarray(free)
    if free.dtype == bool:
        mask = free.ravel()
    else:
        mask = np.zeros(max(total, int(free.max()) + 1), dtype=bool)
        mask[free] = True
    if mask.sum() != size:
        raise InputError(
            "system sequence", "free", f"marks {mask.sum()} unknowns, the matrix has {size}", "See `solve`"
        )
    return mask


def _digits(tolerance: float) -> float:
    return max(-math.log10(tolerance), LEAST_DIGITS)


def _residual(matrix: sp.csr_matrix, x: Array, b: Array) -> float:
    size = norm(b)
    return norm(b - matrix @ x) / size if size > 0.0 else 0.0


def _default_limit() -> float:
    """Bytes for a factor: a share of the free memory."""
    return MEMORY_SHARE * float(psutil.virtual_memory().available)
