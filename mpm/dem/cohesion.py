"""Van der Waals cohesion after Rumpf (2-6, 3-8), as a function and as the tables LAMMPS interpolates."""

import math

import numpy as np

from mpm.arrays import Floats

INNER_CUTOFF = 0.3e-9  # m, smallest distance between molecules; the force is held below it and in contact
OUTER_CUTOFF = 10e-9  # m, no force beyond it
TABLE_SPACING = 0.1e-9  # m; error of the interpolated force <= 0.5 % of its maximum
TABLE_OVERLAP = (
    0.12  # part of the contact distance the table reaches into the overlap; landing beds reach 0.05 at 3 N/m
)


def rumpf_force(separation: Floats, *, hamaker: float, radius: float, asperity: float) -> Floats:
    """Attractive force [N] at the surface separation s [m], any shape.

    F = A R/(6 s^2) (r/(r + R) + 1/(1 + r/s)^2); R = R1 R2/(R1 + R2) between particles and the particle's own
    radius at a flat base, which gives the seed's granular Bond numbers; r the asperity height. s is held at
    0.3 nm from below, and the force ends at 10 nm.
    """
    separation = np.asarray(separation, dtype=float)
    s = np.maximum(separation, INNER_CUTOFF)
    force: Floats = (
        hamaker * radius / (6.0 * s**2) * (asperity / (asperity + radius) + 1.0 / (1.0 + asperity / s) ** 2)
    )
    return np.where(separation <= OUTER_CUTOFF, force, 0.0)


def largest_force(*, hamaker: float, radius: float, asperity: float) -> float:
    """The force in contact [N], the numerator of the granular Bond number."""
    return float(rumpf_force(np.asarray(0.0), hamaker=hamaker, radius=radius, asperity=asperity))


def reduced_hamaker(*, hamaker: float, stiffness: float, material_stiffness: float) -> float:
    """A_r = A sqrt(k_r/k_m): keeps the work of adhesion over the elastic energy when the spring is softened."""
    softened: float = (stiffness / material_stiffness) ** 0.5
    return hamaker * softened


def table_points(contact: float, spacing: float = TABLE_SPACING) -> int:
    """Number of points, `spacing` [m] apart, that cover overlap and range of one contact distance [m]."""
    return int((TABLE_OVERLAP * contact + OUTER_CUTOFF) / spacing) + 1


def table_text(
    keyword: str,
    *,
    contact: float,
    points: int,
    hamaker: float,
    radius: float,
    asperity: float,
    wall: bool = False,
) -> str:
    """One section of a LAMMPS table file over the distance of centres (or centre to wall).

    `contact` is that distance at contact [m]. Pair tables are equidistant in r^2: style and file agree in
    `points` and the upper end is the cutoff to the last bit, so LAMMPS takes the values as they are instead of a
    spline that overshoots at the kink. Wall tables are equidistant in r, at half the spacing. One point lies on
    the kink at 0.3 nm. The energy is the integral of the force from the outer end.
    """
    high, kink = contact + OUTER_CUTOFF, contact + INNER_CUTOFF
    index = np.arange(points, dtype=float)
    if wall:
        high += 2e-9  # here LAMMPS wants the table to reach beyond the cutoff
        step = (high - kink) / round((high - kink) / (0.5 * TABLE_SPACING))
        r = kink + step * (index - (points - 1)) + (high - kink)
    else:
        span = high**2 - kink**2
        # a small pair among large ones shares their number of points: finer, rather than down to r = 0
        finer = math.ceil(span * (points - 1) / (high**2 - (0.5 * contact) ** 2))
        step = span / max(round((high - kink) / TABLE_SPACING), finer)
        r = np.sqrt(high**2 + step * (index - (points - 1)))
    low = float(r[0])
    attraction = rumpf_force(r - contact, hamaker=hamaker, radius=radius, asperity=asperity)
    steps = 0.5 * (attraction[1:] + attraction[:-1]) * np.diff(r)
    energy = -np.append(np.cumsum(steps[::-1])[::-1], 0.0)
    head = f"N {points}" if wall else f"N {points} RSQ {low:.17g} {high:.17g}"
    rows = "\n".join(
        f"{i} {a:.16g} {b:.12g} {c:.12g}"
        for i, (a, b, c) in enumerate(
            zip(r.tolist(), energy.tolist(), (-attraction).tolist(), strict=True), 1
        )
    )
    return f"# Rumpf cohesion, SI units\n\n{keyword}\n{head}\n\n{rows}\n"
