"""From accelerometer data (CSV of t, a_y, a_z) to the few harmonics that describe the conveyor (seed 2.3.3)."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mpm.arrays import Floats
from mpm.constants import GRAVITY
from mpm.errors import InputError
from mpm.files import read_text

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

    t: Floats
    acceleration: Floats


def read_record(path: Path, unit: str = "m/s^2") -> Record:
    """Read columns t, a_y, a_z (`unit` m/s^2 or g), separated by commas, semicolons or tabs; samples may be uneven or unsorted.

    Up to two header lines are allowed. Times are seconds unless the header says ms or us; a unit of the accelerations in
    the header must be `unit`. Decimal commas are read where the columns are separated by something else.
    """
    scale = {"m/s^2": 1.0, "m/s2": 1.0, "g": GRAVITY}.get(unit)
    if scale is None:
        raise InputError(f"{path}: unit of acceleration: found {unit!r}, accepted m/s^2 or g")
    try:
        lines = read_text(path).splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    header, data = _columns(path, lines)
    if len(data) < 16:
        raise InputError(f"{path}: found {len(data)} samples, at least 16 are needed")
    if not np.isfinite(data).all():
        raise InputError(f"{path}: found a number that is not finite")
    count = len(data)
    _, order = np.unique(data[:, 0], return_index=True)
    data = data[order]
    if len(order) < max(16, count / 2):
        raise InputError(
            f"{path}: found {len(order)} distinct times in {count} samples, at least 16 and half of them are needed"
        )
    found = _said_unit(header)
    if found is not None and (found == "g") != (unit == "g"):
        raise InputError(f"{path}: the header says {found}, the unit given is {unit}: make them agree")
    t = (data[:, 0] - data[0, 0]) * _time_scale(header)
    return Record(t, scale * (data[:, 1:] - data[:, 1:].mean(axis=0)).T)


def _columns(path: Path, lines: Sequence[str]) -> tuple[list[str], Floats]:
    """The cells of the last header line (none: empty) and the first three columns as numbers (n, 3)."""
    kept = [
        (i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")
    ]
    separator = next((mark for mark in "\t;" if any(mark in line for _, line in kept)), ",")
    header: list[str] = []
    rows: list[list[float]] = []
    marks: set[str] = set()  # decimal marks met
    for number, line in kept:
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
        while cells and not cells[-1]:
            cells.pop()
        try:
            values = [_number(cell) for cell in cells[:3]]
        except ValueError:
            if not rows and number < 3:
                header = cells
                continue
            raise InputError(
                f"{path}: line {number}: found {line[:40]!r}, expected numbers t,a_y,a_z"
            ) from None
        marks |= {mark for cell in cells[:3] for mark in ",." if mark in cell}
        split_numbers = separator == "," and len(cells) > 5 and not marks
        if split_numbers or (header and len(cells) == 2 * len(header)) or marks == {",", "."}:
            raise InputError(
                f"{path}: line {number}: found {line[:40]!r}, where a comma may be a decimal comma; accepted: decimal points, "
                "or columns separated by semicolons or tabs"
            )
        if len(values) < 3:
            raise InputError(
                f"{path}: line {number}: found {len(values)} columns, expected t,a_y,a_z separated by commas, semicolons or tabs"
            )
        rows.append(values)
    return header, np.array(rows).reshape(-1, 3)


def _number(cell: str) -> float:
    """A number with a decimal point or a decimal comma. Raises ValueError, also for separators of thousands."""
    if "_" in cell or ("," in cell and ("." in cell or cell.count(",") > 1)):
        raise ValueError
    return float(cell.replace(",", "."))


def _time_scale(header: Sequence[str]) -> float:
    """Seconds in the unit of time that a header names, 1 where it names none."""
    found = re.search(r"(?<![A-Za-z])(ms|us|\u00b5s|\u03bcs)(?![A-Za-z])", header[0]) if header else None
    return 1.0 if found is None else 1e-3 if found[1] == "ms" else 1e-6


def _said_unit(header: Sequence[str]) -> str | None:
    """The unit of the accelerations that a header names in brackets or after an underscore."""
    found = re.search(r"[\[(_](g|m/s)(?![A-Za-z])", " ".join(header[1:3]))
    return None if found is None else "g" if found[1] == "g" else "m/s^2"


def resample(t: Floats, signal: Floats) -> tuple[float, Floats]:
    """Constant interval and the signal on it, 2^n points not fewer than the samples (linear interpolation)."""
    n = 1 << int(np.ceil(np.log2(t.size)))
    even = np.linspace(t[0], t[-1], n)
    return float(even[1] - even[0]), np.interp(even, t, signal)


def spectrum(interval: float, signal: Floats) -> tuple[Floats, Floats]:
    """Frequencies [Hz] and single-sided amplitudes of a Hann-windowed FFT."""
    window = np.hanning(signal.size)
    amplitude = 2.0 * np.abs(np.fft.rfft(signal * window)) / window.sum()
    return np.fft.rfftfreq(signal.size, interval), amplitude


def largest_peaks(frequency: Floats, amplitude: Floats, count: int) -> list[tuple[float, float]]:
    """The `count` largest local maxima (frequency, amplitude), at least three bins apart, from bin 2 on."""
    from scipy.signal import find_peaks  # which takes a second to load

    peaks = find_peaks(amplitude[1:], distance=3)[0] + 1
    largest = peaks[np.argsort(-amplitude[peaks])][:count]
    return [(float(frequency[k]), float(amplitude[k])) for k in largest]


def fit_channel(t: Floats, signal: Floats, count: int) -> Fit:
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

    def project(frequencies: Floats) -> tuple[Floats, Floats]:
        arg = 2.0 * np.pi * np.outer(t, frequencies)
        basis = np.hstack([np.cos(arg), np.sin(arg)])
        solution = np.linalg.lstsq(basis, signal, rcond=None)[0]
        return solution, basis @ solution - signal

    from scipy.optimize import least_squares  # as slow to load

    best = least_squares(
        lambda shift: project(start + width * shift)[1], np.zeros(start.size), bounds=(-2.0, 2.0)
    )
    frequencies = start + width * best.x
    solution, residual = project(frequencies)
    a, b = np.split(solution, 2)  # a cos + b sin = A cos(w t - phi), A = |a + ib|, phi = arg(a + ib)
    amplitudes, phases = np.hypot(a, b), np.arctan2(b, a)
    kept = amplitudes >= NOISE * amplitudes.max()
    terms = zip(amplitudes[kept], frequencies[kept], phases[kept], strict=True)
    harmonics = tuple(Harmonic(amplitude=float(A), frequency=float(f), phase=float(p)) for A, f, p in terms)
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
        return replace(h, frequency=fundamental, phase=float(h.phase + turn))

    horizontal = tuple(lock(h) for h in along.harmonics)
    return HarmonicWaveform(horizontal, vertical.harmonics, fundamental).aligned(), along, vertical
