"""BiCGStab (van der Vorst 1992) for systems of which nothing is known but their product with a vector.

PETSc has it, too; here an iteration goes through memory half as often, which at the sizes of a rank is what its time is, and starts again
by itself where it breaks down.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.numerics.compiled import compiled, pointer
from mpm.parallel import total

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

SOURCE = Path(__file__).with_name("bicgstab.c")
FUNCTIONS = """
double dot(long n, const double *a, const double *b);
double first_half(long n, double alpha, const double *v, double *r);
void shares(long n, const double *t, const double *r, const double *shadow, double *sums);
void second_half(long n, double alpha, double omega, double beta, const double *v, const double *t, double *x, double *r, double *p);
"""
ITERATIONS = 1000  # before it counts as failed
# share of a residual along that of the start below which nothing is left of it but rounding, as when one inlet feeds a long column
NOTHING_ALONG = 1e-14
ROUNDING = 4.0 * np.finfo(float).eps  # of the difference of two squares


class BiCGStab:
    """Solves apply(x) = rhs for vectors of `size` numbers on this rank of `comm`; `name` is for its errors.

    `apply(x, result)` makes the product, and may be collective.
    """

    def __init__(self, comm: MPI.Comm, size: int, apply: Callable[[Floats, Floats], None], name: str):
        self.comm, self.name, self._apply, self._size = comm, name, apply, size
        self._c = compiled(comm, SOURCE, FUNCTIONS)
        self._p, self._v, self._t, self._shadow = (np.zeros(size) for _ in range(4))
        self._sums = np.zeros(4)

    def solve(self, r: Floats, tolerance: float, least: float) -> tuple[Floats, int]:
        """The solution from a guess of nothing and the number of iterations, for the right-hand side `r`, which becomes the residual;
        collective.

        It stops where the 2-norm of the residual is not above `tolerance` times its first one, or `least`. Raises ConvergenceError.
        """
        c, n, x = self._c, self._size, np.zeros(self._size)
        p, v, t, shadow, sums = self._p, self._v, self._t, self._shadow, self._sums
        at_r, at_p, at_v, at_t, at_x, at_shadow = map(pointer, (r, p, v, t, x, shadow))
        square = self._total([c.dot(n, at_r, at_r)])[0]
        goal = max(tolerance**2 * square, least**2)
        started = rho = 0.0  # squared residual and its part along the shadow, since the start
        for iteration in range(ITERATIONS + 1):
            if square <= goal < np.inf:
                return x, iteration
            fresh = rho * rho <= NOTHING_ALONG**2 * square * started
            if fresh:
                shadow[:] = p[:] = r
                started = rho = square
            self._apply(p, v)
            along = self._total([c.dot(n, at_shadow, at_v)])[0]
            if along == 0.0 and not fresh:
                rho = 0.0  # starts again
                continue
            if along == 0.0 or not np.isfinite(along):
                break
            alpha = rho / along
            half = c.first_half(n, alpha, at_v, at_r)
            self._apply(r, t)
            c.shares(n, at_t, at_r, at_shadow, pointer(sums))
            half, with_t, of_t, along_r, along_t = self._total([half, *sums])
            omega = with_t / of_t if of_t > 0.0 and half > goal else 0.0
            new = along_r - omega * along_t
            beta = new / rho * alpha / omega if omega != 0.0 else 0.0
            c.second_half(n, alpha, omega, beta, at_v, at_t, at_x, at_r, at_p)
            square = max(half - omega * with_t, ROUNDING * half)
            if not np.isfinite(square):
                break
            rho = new if omega != 0.0 else 0.0  # else it starts again, unless that was the end
        raise ConvergenceError(
            f"{self.name}: the linear solver stopped after {iteration} iterations at residual {np.sqrt(square):.3g}"
        )

    def _total(self, values: list[float] | Floats) -> list[float]:
        if self.comm.size == 1:
            return list(values)
        return [float(value) for value in total(self.comm, values)]
