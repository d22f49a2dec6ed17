"""What `mpm dem waveform` makes of a fit: waveform.json, waveform.toml (a section for a powder file), a picture, lines for the screen."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mpm.files import write_atomically, write_picture
from mpm.plain import json_text

from .accelerometer import Fit, Record, resample, spectrum
from .report import BASE, BED, FIT
from .waveform import HarmonicWaveform, extension_velocity, peak_displacement

FitOfRecord = tuple[HarmonicWaveform, Fit, Fit]
"""Of `fit_record`: the waveform, and the fits of the channels along the conveyor and vertical."""


def write_fit(directory: Path, record: Record, fit: FitOfRecord) -> None:
    """All files."""
    write_atomically(directory / "waveform.json", json_text(numbers(fit), "waveform.json"))
    write_atomically(directory / "waveform.toml", section(fit[0]))
    draw(directory / "waveform.png", record, fit)


def numbers(fit: FitOfRecord) -> dict[str, Any]:
    """Harmonics with what the fit made of the FFT's amplitudes, how much they explain, and what the motion amounts to. SI."""
    fitted, along, vertical = fit
    peaks = dict(zip(("horizontal", "vertical"), peak_displacement(fitted), strict=True))
    return {
        "frequency": fitted.frequency,
        "peak_displacement": peaks,
        "extension_velocity": extension_velocity(fitted),
        "horizontal": _channel(fitted, along, 0),
        "vertical": _channel(fitted, vertical, 1),
    }


def _channel(fitted: HarmonicWaveform, fit: Fit, row: int) -> dict[str, Any]:
    return {
        "explained_variance": fit.explained,
        "harmonics": [
            {
                "amplitude": harmonic.amplitude,
                "frequency": harmonic.frequency,
                "phase": harmonic.phase,
                "amplitude_correction": correction,
            }
            for harmonic, correction in zip(fitted.rows[row], fit.correction, strict=True)
        ],
    }


def section(fitted: HarmonicWaveform) -> str:
    """The waveform as a section of a powder file."""
    tables = [f'[waveform]\nkind = "harmonics"\nfrequency = "{fitted.frequency!r} Hz"']
    for name, harmonics in zip(("horizontal", "vertical"), fitted.rows, strict=True):
        tables += [
            f"[[waveform.{name}]]\n"
            f'amplitude = "{h.amplitude!r} m/s^2"\nfrequency = "{h.frequency!r} Hz"\nphase = "{h.phase!r} rad"'
            for h in harmonics
        ]
    return "\n".join(tables) + "\n"


def lines(fit: FitOfRecord) -> Iterator[str]:
    """The fit for the screen."""
    fitted, *channels = fit
    yield f"fundamental {fitted.frequency:.3f} Hz"
    for name, harmonics, channel in zip(("horizontal", "vertical"), fitted.rows, channels, strict=True):
        yield f"{name}: {100 * channel.explained:.1f} % of the variance"
        for h, correction in zip(harmonics, channel.correction, strict=True):
            yield (
                f"  {h.amplitude:8.3f} m/s2 at {h.frequency:8.3f} Hz, phase {h.phase:+.3f} rad "
                f"(FFT amplitude x {correction:.3f})"
            )


def draw(path: Path, record: Record, fit: FitOfRecord) -> None:
    """Four cycles of accelerometer data with the fitted harmonics, the spectra, and the displacements."""
    fitted, along, vertical = fit
    clock = HarmonicWaveform(along.harmonics, vertical.harmonics, fitted.frequency)  # that of the record
    t, span = record.t, 4.0 / fitted.frequency
    smooth = np.linspace(0.0, span, 800)
    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    axes = figure.subplots(2, 3)
    for row, name in enumerate(("along", "vertical")):
        data, peaks, moved = axes[row]
        acceleration, terms = record.acceleration[row], clock.rows[row]
        data.plot(1e3 * t[t < span], acceleration[t < span], ".", ms=3, color=BASE, label="data")
        data.plot(1e3 * smooth, clock.acceleration(smooth)[row], color=BED, lw=1.0, label="fit")
        data.set(xlabel="t [ms]", ylabel=f"acceleration {name} [m/s²]")
        frequency, amplitude = spectrum(*resample(t, acceleration))
        peaks.plot(frequency, amplitude, color=BASE, lw=0.8, label="FFT")
        peaks.plot(
            [h.frequency for h in terms], [h.amplitude for h in terms], "o", color=BED, ms=4, label="fit"
        )
        peaks.set(xlabel="frequency [Hz]", ylabel="amplitude [m/s²]", xlim=(0, min(frequency[-1], 500)))
        moved.plot(1e3 * smooth, 1e6 * clock.displacement(smooth)[row], color=FIT)
        moved.set(xlabel="t [ms]", ylabel=f"displacement {name} [µm]")
    for axis in axes[0, :2]:
        axis.legend(frameon=False)
    write_picture(path, figure, dpi=150)
