"""From accelerometer data (CSV of t, a_y, a_z) to the few harmonics that describe the conveyor (seed 2.3.3)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from mpm.errors import InputError
from mpm.files import read_text

from ..constants import GRAVITY
from .waveform import Harmonic, HarmonicWaveform

NOISE = (
    0.02  # of the largest amplitude of a channel: smaller peaks are noise, which integration would magnify
)


@dataclass(frozen=True)
class Fit:
    """Harmonics of one channel and how well they describe it.

    `correction` is the fitted over the raw FFT amplitude of each harmonic (the seed's "mod factor", here per
    harmonic and fitted instead of guessed); `explained` the share of the signal's variance.
    """

    harmonics: tuple[Harmonic, ...]
    correction: tuple[float, ...]
    explained: float


@dataclass(frozen=True)
class Record:
    """Accelerations [m/s2] (2, n) without their mean, at times t [s] (n,), rows (along the conveyor, vertical)."""

    t: np.ndarray
    acceleration: np.ndarray


def read_record(path: Path, unit: str = "m/s^2") -> Record:
    """Read columns t [s], a_y, a_z (`unit` m/s^2 or g); a header line and uneven or unsorted samples are allowed."""
    scale = {"m/s^2": 1.0, "m/s2": 1.0, "g": GRAVITY}.get(unit)
    if scale is None:
        raise InputError(f"{path}: unit of acceleration: found {unit!r}, accepted m/s^2 or g")
    try:
        lines = [line for line in read_text(path).splitlines() if line.strip()]
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    rows: list[list[float]] = []
    for number, line in enumerate(lines):
        if line.lstrip().startswith("#"):
            continue
        try:
            values = [float(v) for v in line.replace(";", ",").split(",")[:3]]
        except ValueError:
            if not rows and number < 2:
                continue  # header
            raise InputError(
                f"{path}: line {number + 1}: found {line[:40]!r}, expected numbers t,a_y,a_z"
            ) from None
        if len(values) < 3:
            raise InputError(f"{path}: line {number + 1}: found {len(values)} columns, expected t,a_y,a_z")
        rows.append(values)
    data = np.array(rows)
    if len(rows) < 16:
        raise InputError(f"{path}: found {len(rows)} samples, at least 16 are needed")
    if not np.isfinite(data).all():
        raise InputError(f"{path}: found a number that is not finite")
    _, order = np.unique(data[:, 0], return_index=True)
    data = data[order]
    if len(order) < 16:
        raise InputError(f"{path}: found {len(order)} distinct times, at least 16 are needed")
    acceleration = scale * (data[:, 1:] - data[:, 1:].mean(axis=0)).T
    return Record(data[:, 0] - data[0, 0], acceleration)


def resample(t: np.ndarray, signal: np.ndarray) -> tuple[float, np.ndarray]:
    """Constant interval and the signal on it, 2^n points not fewer than the samples (linear interpolation)."""
    n = 1 << int(np.ceil(np.log2(t.size)))
    even = np.linspace(t[0], t[-1], n)
    return float(even[1] - even[0]), np.interp(even, t, signal)


def spectrum(interval: float, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and single-sided amplitudes of a Hann-windowed FFT."""
    window = np.hanning(signal.size)
    amplitude = 2.0 * np.abs(np.fft.rfft(signal * window)) / window.sum()
    return np.fft.rfftfreq(signal.size, interval), amplitude


def largest_peaks(frequency: np.ndarray, amplitude: np.ndarray, count: int) -> list[tuple[float, float]]:
    """The `count` largest local maxima (frequency, amplitude), at least three bins apart and above bin 2."""
    inner = np.arange(2, amplitude.size - 1)
    peaks = inner[(amplitude[inner] >= amplitude[inner - 1]) & (amplitude[inner] > amplitude[inner + 1])]
    chosen: list[int] = []
    for k in peaks[np.argsort(-amplitude[peaks])]:
        if all(abs(int(k) - other) > 2 for other in chosen):
            chosen.append(int(k))
        if len(chosen) == count:
            break
    return [(float(frequency[k]), float(amplitude[k])) for k in chosen]


def fit_channel(t: np.ndarray, signal: np.ndarray, count: int) -> Fit:
    """The `count` largest harmonics: FFT peaks, then frequency, amplitude and phase by least squares.

    The fit uses the original, unevenly spaced samples, so neither the resampling nor the leakage of the FFT
    biases it. For given frequencies, amplitude and phase are a linear problem (variable projection).
    """
    interval, even = resample(t, signal)
    peaks = largest_peaks(*spectrum(interval, even), count)
    if not peaks:
        return Fit((), (), 0.0)
    start = np.array([f for f, _ in peaks])
    width = 1.0 / (t[-1] - t[0])

    def project(frequencies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        arg = 2.0 * np.pi * np.outer(t, frequencies)
        basis = np.hstack([np.cos(arg), np.sin(arg)])
        solution = np.linalg.lstsq(basis, signal, rcond=None)[0]
        return solution, basis @ solution - signal

    best = least_squares(
        lambda shift: project(start + width * shift)[1], np.zeros(start.size), bounds=(-2.0, 2.0)
    )
    frequencies = start + width * best.x
    solution, residual = project(frequencies)
    a, b = np.split(solution, 2)  # a cos + b sin = A cos(w t - phi), A = |a + ib|, phi = arg(a + ib)
    amplitudes, phases = np.hypot(a, b), np.arctan2(b, a)
    kept = amplitudes >= NOISE * amplitudes.max()
    terms = zip(amplitudes[kept], frequencies[kept], phases[kept], strict=True)
    harmonics = tuple(Harmonic(float(A), float(f), float(p)) for A, f, p in terms)
    raw = np.array([amplitude for _, amplitude in peaks])[kept]
    correction = tuple((amplitudes[kept] / raw).tolist())
    return Fit(harmonics, correction, float(1.0 - residual.var() / signal.var()))


def fit_record(record: Record, count: int = 3) -> tuple[HarmonicWaveform, Fit, Fit]:
    """Waveform from a record, with the fits of the two channels.

    The fundamental is the vertical harmonic of the largest *displacement*; a horizontal harmonic within the
    resolution of the record takes exactly its frequency.
    """
    along, vertical = (fit_channel(record.t, row, count) for row in record.acceleration)
    if not vertical.harmonics:
        raise InputError("accelerometer data: no harmonic found in the vertical channel")
    fundamental = max(vertical.harmonics, key=lambda h: h.amplitude / h.frequency**2).frequency
    duration = float(record.t[-1])

    def lock(h: Harmonic) -> Harmonic:
        if abs(h.frequency - fundamental) >= 1.0 / duration:
            return h
        # keep the phase in the middle of the record
        turn = 2.0 * np.pi * (fundamental - h.frequency) * 0.5 * duration
        return Harmonic(h.amplitude, fundamental, float(h.phase + turn))

    horizontal = tuple(lock(h) for h in along.harmonics)
    return HarmonicWaveform(horizontal, vertical.harmonics, fundamental).aligned(), along, vertical
