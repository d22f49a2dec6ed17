"""Waveforms of the conveyor: two components (x along the conveyor, z normal to it), any periodic shape.

Every waveform gives displacement, velocity and acceleration as arrays of shape (2, n) for times of shape (n,),
and is placed so that the vertical fundamental passes zero upwards at t = 0.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GRAVITY


class Waveform(Protocol):
    """What the box, the sampling and the profile ask of a waveform."""

    @property
    def frequency(self) -> float:
        """Fundamental frequency [Hz]: one cycle of the profile."""

    def displacement(self, t: Floats) -> Floats: ...
    def velocity(self, t: Floats) -> Floats: ...
    def acceleration(self, t: Floats) -> Floats: ...


@dataclass(frozen=True, kw_only=True)
class Harmonic:
    """One term A cos(2 pi f t - phi) of an acceleration (2-7): A [m/s2], f [Hz], phi [rad]."""

    amplitude: float
    frequency: float
    phase: float = -math.pi / 2.0


@dataclass(frozen=True)
class HarmonicWaveform:
    """Sum of harmonics per direction (2-7 ... 2-9). Harmonics need not be multiples of the fundamental."""

    horizontal: tuple[Harmonic, ...]
    vertical: tuple[Harmonic, ...]
    frequency: float

    @property
    def rows(self) -> tuple[tuple[Harmonic, ...], tuple[Harmonic, ...]]:
        """Harmonics along the conveyor and vertical."""
        return self.horizontal, self.vertical

    def acceleration(self, t: Floats) -> Floats:
        """x'' = sum A cos(w t - phi) (2-7)."""
        return self._sum(t, lambda h, arg, w: h.amplitude * np.cos(arg))

    def velocity(self, t: Floats) -> Floats:
        """x' = sum A/w sin(w t - phi) (2-8)."""
        return self._sum(t, lambda h, arg, w: h.amplitude / w * np.sin(arg))

    def displacement(self, t: Floats) -> Floats:
        """x = -sum A/w^2 cos(w t - phi) (2-9)."""
        return self._sum(t, lambda h, arg, w: -h.amplitude / w**2 * np.cos(arg))

    def _sum(self, t: Floats, term: Callable[[Harmonic, Floats, float], Floats]) -> Floats:
        t = np.atleast_1d(np.asarray(t, dtype=float))
        out = np.zeros((2, t.size))
        for row, harmonics in enumerate(self.rows):
            for h in harmonics:
                w = 2.0 * math.pi * h.frequency
                out[row] += term(h, w * t - h.phase, w)
        return out

    def shifted(self, t0: float) -> "HarmonicWaveform":
        """The same motion with the clock starting at t0."""

        def shift(harmonics: tuple[Harmonic, ...]) -> tuple[Harmonic, ...]:
            return tuple(
                replace(h, phase=_wrap(h.phase - 2.0 * math.pi * h.frequency * t0)) for h in harmonics
            )

        return HarmonicWaveform(shift(self.horizontal), shift(self.vertical), self.frequency)

    def aligned(self) -> "HarmonicWaveform":
        """Shifted so that the fundamental (vertical, else horizontal) passes zero upwards at t = 0."""
        for harmonics in (self.vertical, self.horizontal):
            for h in harmonics:
                if math.isclose(h.frequency, self.frequency, rel_tol=1e-9) and h.amplitude != 0.0:
                    phase = h.phase if h.amplitude > 0.0 else h.phase + math.pi
                    return self.shifted((phase + math.pi / 2.0) / (2.0 * math.pi * h.frequency))
        return self

    def scaled(self, factor: float) -> "HarmonicWaveform":
        """All accelerations times `factor` (e.g. 0.7/1.05 for the seed's 0.7 g cases)."""

        def scale(harmonics: tuple[Harmonic, ...]) -> tuple[Harmonic, ...]:
            return tuple(replace(h, amplitude=factor * h.amplitude) for h in harmonics)

        return HarmonicWaveform(scale(self.horizontal), scale(self.vertical), self.frequency)


@dataclass(frozen=True, kw_only=True)
class Sawtooth:
    """The pseudo-sawtooth (2-10 ... 2-12): a slow half sine out, a fast one back, equal displacements.

    `ratio` = f_a/f_1 < 1 of the extension (seed: 2/3); 1/f_a + 1/f_b = 2/f_1. Displacement amplitudes [m].
    The seed's phi_1 = pi/2 starts the cycle at full retraction; here it starts at zero displacement.
    """

    horizontal: float
    vertical: float
    frequency: float
    ratio: float = 2.0 / 3.0

    @property
    def extension_frequency(self) -> float:
        return self.ratio * self.frequency

    @property
    def retraction_frequency(self) -> float:
        """f_b from 1/f_a + 1/f_b = 2/f_1 (2-10)."""
        return 1.0 / (2.0 / self.frequency - 1.0 / self.extension_frequency)

    def displacement(self, t: Floats) -> Floats:
        return self._evaluate(t, 0)

    def velocity(self, t: Floats) -> Floats:
        return self._evaluate(t, 1)

    def acceleration(self, t: Floats) -> Floats:
        return self._evaluate(t, 2)

    def _evaluate(self, t: Floats, derivative: int) -> Floats:
        t = np.atleast_1d(np.asarray(t, dtype=float))
        period = 1.0 / self.frequency
        quarter = 0.25 / self.extension_frequency
        t = np.mod(t + quarter, period) - quarter  # extension runs over (-quarter, quarter)
        wa, wb = 2.0 * math.pi * self.extension_frequency, 2.0 * math.pi * self.retraction_frequency
        out_arg, back_arg = wa * t, wb * (t - quarter) + math.pi / 2.0
        shift = derivative * math.pi / 2.0  # d/dt sin(a) = w sin(a + pi/2)
        shape = np.where(
            t <= quarter, wa**derivative * np.sin(out_arg + shift), wb**derivative * np.sin(back_arg + shift)
        )
        return np.array([[self.horizontal], [self.vertical]]) * shape


def sine(*, gamma: float, frequency: float, angle: float, angle_from: str = "horizontal") -> HarmonicWaveform:
    """A pure sine whose vertical acceleration is gamma g; displacement (X, Z) sin(w t).

    `angle` [rad] from the horizontal (Z/X = tan angle) or from the vertical (X/Z = tan angle).
    """
    vertical = gamma * GRAVITY
    horizontal = vertical / math.tan(angle) if angle_from == "horizontal" else vertical * math.tan(angle)
    return HarmonicWaveform(
        (Harmonic(amplitude=horizontal, frequency=frequency),),
        (Harmonic(amplitude=vertical, frequency=frequency),),
        frequency,
    )


def from_table(t: Floats, acceleration: Floats, harmonics: int = 16) -> HarmonicWaveform:
    """One period of accelerations, t of shape (n,), acceleration (2, n) [m/s2], as a Fourier series.

    Samples may be uneven; the last one lies a period after the first, whose place it takes. A mean acceleration cannot belong to a
    periodic motion and is dropped.
    """
    from scipy.interpolate import CubicSpline  # which takes a second to load

    t = np.asarray(t, dtype=float)
    acceleration = np.asarray(acceleration, dtype=float)
    period = float(t[-1] - t[0])
    inside = t - t[0] < period * (1.0 - 1e-9)
    t, acceleration = t[inside], acceleration[:, inside]
    closed = np.append(t, t[0] + period)
    n = 1 << max(6, math.ceil(math.log2(8 * harmonics)))
    even = t[0] + np.arange(n) * period / n
    rows: list[tuple[Harmonic, ...]] = []
    for row in acceleration:
        spectrum = np.fft.rfft(CubicSpline(closed, np.append(row, row[0]), bc_type="periodic")(even)) / n
        rows.append(
            tuple(
                Harmonic(
                    amplitude=2.0 * abs(spectrum[m]),
                    frequency=m / period,
                    phase=_wrap(-np.angle(spectrum[m])),
                )
                for m in range(1, harmonics + 1)
                if abs(spectrum[m]) > 1e-9
            )
        )
    return HarmonicWaveform(rows[0], rows[1], 1.0 / period).aligned()


def extension_velocity(waveform: Waveform, samples: int = 4096) -> float:
    """Largest velocity of the base along +x over one cycle [m/s], the v_w,max of (2-13)."""
    t = np.arange(samples) / samples / waveform.frequency
    return float(waveform.velocity(t)[0].max())


def peak_displacement(waveform: Waveform, samples: int = 4096) -> tuple[float, float]:
    """Half the peak-to-peak displacement (x, z) over one cycle [m]."""
    t = np.arange(samples) / samples / waveform.frequency
    x, z = np.ptp(waveform.displacement(t), axis=1) / 2.0
    return float(x), float(z)


def seed_table_2_2() -> HarmonicWaveform:
    """The seed's fitted accelerometer data, table 2.2, aligned.

    The text scrambles the columns; the one reading that closes is 1Y 10.581 and 1Z 10.273 m/s2 (48 Hz, 3.08 rad),
    2Z 10.114 (192 Hz, -2.66). 3Z 9.154 m/s2 at 167 Hz, -1.38 rad is an inference.
    """
    return HarmonicWaveform(
        horizontal=(Harmonic(amplitude=10.581, frequency=48.0, phase=3.08),),
        vertical=(
            Harmonic(amplitude=10.273, frequency=48.0, phase=3.08),
            Harmonic(amplitude=10.114, frequency=192.0, phase=-2.66),
            Harmonic(amplitude=9.154, frequency=167.0, phase=-1.38),
        ),
        frequency=48.0,
    ).aligned()


def _wrap(phase: float) -> float:
    """Phase in (-pi, pi]."""
    return math.pi - (math.pi - phase) % (2.0 * math.pi)
