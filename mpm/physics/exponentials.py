"""Functions of the exponential that lose their digits near zero when written as they stand: Bernoulli's, and the phi functions.

    B(z) = z / (exp z - 1)        exponential fitting of a flux (Scharfetter and Gummel 1969)
    phi_1(x) = (1 - exp(-x)) / x,  phi_2(x) = (1 - phi_1(x)) / x        exponential integrators, here for decay over a time

`scipy.special.exprel` gives phi_1 to 3e-16 and 1/B to 1.4e-15 as they are here, but costs each rank 33 MB: nothing else that a rank
runs needs scipy.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mpm.arrays import Floats


def bernoulli(z: Floats) -> Floats:
    """B(z) = z / (exp z - 1), with its series near 0 and no overflow for any finite z."""
    z = np.asarray(z, dtype=float)
    small = np.abs(z) < 1e-3
    near, far = np.where(small, z, 0.0), np.where(small, 1.0, np.minimum(z, 700.0))
    return np.where(small, 1.0 - near / 2.0 + near * near / 12.0, far / np.expm1(far))


def bernoulli_slope(z: Floats) -> Floats:
    """B'(z) = B(z) (1 - B(-z)) / z, between -1 and 0, with its series near 0."""
    z = np.asarray(z, dtype=float)
    small = np.abs(z) < 1e-3
    far = np.where(small, 1.0, np.clip(z, -700.0, 700.0))
    return np.where(small, -0.5 + z / 6.0, bernoulli(far) * (1.0 - bernoulli(-far)) / far)


def phi1(x: Floats) -> Floats:
    """(1 - exp(-x)) / x for x >= 0."""
    return _series(
        x,
        lambda v: -np.expm1(-v) / v,
        (1.0, -1.0 / 2.0, 1.0 / 6.0, -1.0 / 24.0, 1.0 / 120.0, -1.0 / 720.0, 1.0 / 5040.0),
    )


def phi2(x: Floats) -> Floats:
    """(1 - phi1(x)) / x for x >= 0."""
    return _series(
        x,
        lambda v: (1.0 + np.expm1(-v) / v) / v,
        (1.0 / 2.0, -1.0 / 6.0, 1.0 / 24.0, -1.0 / 120.0, 1.0 / 720.0, -1.0 / 5040.0, 1.0 / 40320.0),
    )


def dphi1(x: Floats) -> Floats:
    """Derivative of phi1."""
    return _series(
        x,
        lambda v: (np.exp(-v) + np.expm1(-v) / v) / v,
        (-1.0 / 2.0, 1.0 / 3.0, -1.0 / 8.0, 1.0 / 30.0, -1.0 / 144.0, 1.0 / 840.0, -1.0 / 5760.0),
    )


def dphi2(x: Floats) -> Floats:
    """Derivative of phi2."""
    return _series(
        x,
        lambda v: -((np.exp(-v) + np.expm1(-v) / v) / v + (1.0 + np.expm1(-v) / v) / v) / v,
        (-1.0 / 6.0, 1.0 / 12.0, -1.0 / 40.0, 1.0 / 180.0, -1.0 / 1008.0, 1.0 / 6720.0, -1.0 / 51840.0),
    )


def _series(x: Floats, closed: Callable[[Floats], Floats], coefficients: tuple[float, ...]) -> Floats:
    """`closed` away from 0, its Taylor polynomial where cancellation would spoil it; what that leaves out is below rounding."""
    small = x < 0.02
    polynomial = np.polynomial.polynomial.polyval(x, coefficients)
    return np.where(small, polynomial, closed(np.where(small, 1.0, x)))
