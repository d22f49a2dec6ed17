"""Powers of amounts that may run out.

    x^p above a trace s of x;  s^p ((2 - p) z + (p - 1) z^2), z = x/s, below it, for p < 1

A rate of an order below one would take what is not there (its slope at zero is infinite, and of order zero it does not even vanish): below
the trace it falls to nothing along a parabola that meets x^p with its slope, so that rates are smooth and concave, and no step, however
long, makes an amount negative.
"""

from __future__ import annotations

import numpy as np

from mpm.arrays import Floats

TRACE = 1e-13
"""Of a concentration [mol/m3] and of a coverage: below 1e-8 of any feed and of all places."""


def power(x: Floats, order: float) -> tuple[Floats, Floats]:
    """x^order of x >= 0 and its slope, with orders below one smoothed below TRACE."""
    if order == 1.0:
        return x, np.ones_like(x)
    if order == 2.0:
        return x * x, 2.0 * x
    if order > 1.0:
        below = x ** (order - 1.0)
        return below * x, order * below
    z = x / TRACE
    far = np.maximum(x, TRACE)
    value, scale = far**order, TRACE ** (order - 1.0)
    near = z < 1.0
    return (
        np.where(near, TRACE * scale * z * ((2.0 - order) + (order - 1.0) * z), value),
        np.where(near, scale * ((2.0 - order) + 2.0 * (order - 1.0) * z), order * value / far),
    )
