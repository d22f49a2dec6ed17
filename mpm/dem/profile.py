"""The bridge to the reactor: bed velocity over one cycle as a table, its piecewise fit, and the fit scaled to a mean."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mpm.arrays import Floats
from mpm.case.profile import COLUMNS, Conditions
from mpm.constants import GRAVITY
from mpm.files import write_atomically

from .waveform import Waveform, peak_displacement

SINE = 0.02
"""Share of its amplitude by which a displacement may differ from a sine: what a reactor that vibrates in one would not notice."""


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Lab-frame velocity of the bed over one cycle at n equidistant phases from 0.

    phase [deg] (n,), velocity (2, n) = (u_x, u_y) [m/s], contact (n,): share of the time in contact.
    Phase 0: the reactor passes its mean position upwards.
    """

    phase: Floats
    velocity: Floats
    contact: Floats

    @property
    def mean(self) -> float:
        """Cycle mean of u_x [m/s]."""
        return float(self.velocity[0].mean())

    def write(self, path: Path, remarks: Sequence[str]) -> None:
        """Write the table; the remarks, of which one tells the `conditions`, follow the header as comment lines."""
        rows = np.column_stack([self.phase, *self.velocity, self.contact])
        lines = [",".join(COLUMNS), *(f"# {line}" for line in remarks)]
        lines += [",".join(f"{value:.9g}" for value in row) for row in rows]
        write_atomically(path, "\n".join(lines) + "\n")


def conditions(waveform: Waveform, kind: str, samples: int = 4096) -> Conditions:
    """What a profile must be used with: frequency, largest vertical acceleration over g, angle of the displacement from the base.

    The reactor vibrates in a sine along a line. Where the waveform does so to SINE of its amplitudes it is called one, else by `kind`, its
    word in the powder file. Of a sine the numbers are those of the powder file.
    """
    t = np.arange(samples) / samples / waveform.frequency
    peaks = np.array(peak_displacement(waveform, samples))
    off = waveform.displacement(t) - peaks[:, None] * np.sin(2.0 * np.pi * waveform.frequency * t)
    is_sine = bool((np.abs(off).max(axis=1) <= SINE * peaks).all())
    gamma = float(np.abs(waveform.acceleration(t)[1]).max()) / GRAVITY
    return Conditions.model_construct(
        frequency=waveform.frequency,
        gamma=gamma,
        angle=float(np.arctan2(peaks[1], peaks[0])),
        waveform="sine" if is_sine else kind,
    )


@dataclass(frozen=True)
class PiecewiseFit:
    """The seed's idealisation: the base's velocity in contact, a constant velocity in flight.

    liftoff, contact [deg]: where u_x leaves and joins the base's; flight (2,): u_x and u_y in flight [m/s];
    rms: of u_x against the curve [m/s].
    """

    liftoff: float
    contact: float
    flight: Floats
    rms: float
    profile: Profile


def piecewise_fit(curve: Profile, base: Floats) -> PiecewiseFit:
    """Least-squares fit of lift-off phase, contact phase and flight velocity to u_x of the curve.

    `base` (2, n): velocity of the base at the same phases. All pairs of phases are tried (prefix sums make that
    n^2 cheap evaluations); for a pair the best flight velocity is the mean of the curve in flight. Vertically the
    bed flies at the constant velocity that lets it meet the base again, unless following the base all the time
    describes the curve better: a bed that slips without lifting off.
    """
    n = len(curve.phase)
    u = curve.velocity[0]
    twice = np.concatenate([u, u])
    miss = np.cumsum(np.concatenate([[0.0], np.tile((u - base[0]) ** 2, 2)]))
    first = np.cumsum(np.concatenate([[0.0], twice]))
    second = np.cumsum(np.concatenate([[0.0], twice**2]))
    start = np.arange(n)[:, None]
    length = np.arange(1, n)[None, :]
    end = start + length  # flight over [start, end)
    flown, flown2 = first[end] - first[start], second[end] - second[start]
    error = (miss[n] - (miss[end] - miss[start])) + flown2 - flown**2 / length
    i, j = np.unravel_index(int(np.argmin(error)), error.shape)
    return _piecewise(curve, base, int(i), int(j) + 1, None)


def _piecewise(curve: Profile, base: Floats, start: int, length: int, mean: float | None) -> PiecewiseFit:
    n = len(curve.phase)
    flying = (np.arange(n) - start) % n < length
    flight = np.array([curve.velocity[0, flying].mean(), -base[1, ~flying].sum() / length])
    if mean is not None:
        flight[0] = (mean * n - base[0, ~flying].sum()) / length
    velocity = np.where(flying, flight[:, None], base)
    if ((base[1] - curve.velocity[1]) ** 2).sum() <= ((velocity[1] - curve.velocity[1]) ** 2).sum():
        velocity[1] = base[1]
    step = 360.0 / n
    rms = float(np.sqrt(((velocity[0] - curve.velocity[0]) ** 2).mean()))
    # the change happens between two samples
    liftoff, contact = ((start - 0.5) * step) % 360.0, ((start + length - 0.5) * step) % 360.0
    profile = Profile(phase=curve.phase, velocity=velocity, contact=(~flying).astype(float))
    return PiecewiseFit(liftoff, contact, flight, rms, profile)


def scaled_to_mean(fit: PiecewiseFit, curve: Profile, base: Floats, mean: float) -> PiecewiseFit:
    """The same phases with the flight velocity that gives the cycle mean `mean` [m/s]."""
    step = 360.0 / len(curve.phase)
    start = round(fit.liftoff / step + 0.5) % len(curve.phase)
    length = round(((fit.contact - fit.liftoff) % 360.0) / step)
    return _piecewise(curve, base, start, length, mean)
