"""Anderson's acceleration of a fixed point x = G(x): the next iterate is the best mixture of the last ones (Anderson 1965; Walker and Ni,
SIAM J. Numer. Anal. 49, 1715, 2011)."""

from __future__ import annotations

import numpy as np

from mpm.arrays import Floats
from mpm.parallel import total

from mpi4py import MPI  # isort: skip

SMALLEST = 1e-10  # singular values over the largest that still count


class Anderson:
    """Keeps the last `depth` differences of iterates, spread over the ranks of `comm`, with `weights` (own,) in their scalar products."""

    def __init__(self, comm: MPI.Comm, weights: Floats, depth: int):
        self.comm, self.weights, self.depth = comm, weights, depth
        self._moves: list[Floats] = []
        self._changes: list[Floats] = []
        self._last: tuple[Floats, Floats] | None = None

    def next(self, x: Floats, image: Floats, share: float = 1.0) -> Floats:
        """What to try after `x`, whose image under G is `image`; a `share` below 1 damps. Collective."""
        residual = image - x
        if self._last is not None:
            self._moves = [*self._moves, x - self._last[0]][-self.depth :]
            self._changes = [*self._changes, residual - self._last[1]][-self.depth :]
        self._last = (x, residual)
        if not self._changes:
            return x + share * residual
        moves, changes = np.stack(self._moves), np.stack(self._changes)
        weighed = changes * self.weights
        products = total(self.comm, np.column_stack([weighed @ changes.T, weighed @ residual]))
        mixture = np.linalg.lstsq(products[:, :-1], products[:, -1], rcond=SMALLEST)[0]
        return np.asarray(x + share * residual - mixture @ (moves + share * changes))
