"""The waveform of a powder file: `[waveform]` with its `kind`."""

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from mpm.units import Angle, Dimension, Frequency, Positive

from ..constants import GRAVITY
from .accelerometer import fit_record, read_record
from .waveform import Harmonic, HarmonicWaveform, Sawtooth, Waveform, from_table, seed_table_2_2, sine

Acceleration = Annotated[float, Dimension("m/s^2", "an acceleration", "10.581 m/s^2")]
Inclination = Annotated[float, Dimension("rad", "an angle", "60 deg", above=0.0, below=math.pi / 2)]


class Section(BaseModel):
    """A table of a powder file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SineInput(Section):
    """A pure sine of the vertical acceleration `gamma` g."""

    kind: Literal["sine"]
    gamma: Positive
    frequency: Frequency
    angle: Inclination = math.pi / 3
    angle_from: Literal["horizontal", "vertical"] = "horizontal"

    def build(self, directory: Path) -> Waveform:
        return sine(self.gamma, self.frequency, self.angle, self.angle_from)


class SawtoothInput(Section):
    """The pseudo-sawtooth with the displacement of a sine of the vertical acceleration `gamma` g."""

    kind: Literal["sawtooth"]
    gamma: Positive
    frequency: Frequency
    angle: Inclination = math.pi / 4
    angle_from: Literal["horizontal", "vertical"] = "horizontal"
    extension_ratio: Annotated[float, Dimension("", "f_a/f_1", "0.6667", above=0.5, below=1.0)] = 2.0 / 3.0

    def build(self, directory: Path) -> Waveform:
        like = sine(self.gamma, self.frequency, self.angle, self.angle_from)
        x, z = (
            h[0].amplitude / (2.0 * math.pi * self.frequency) ** 2 for h in (like.horizontal, like.vertical)
        )
        return Sawtooth(x, z, self.frequency, self.extension_ratio)


class SeedInput(Section):
    """The seed's table 2.2: the first `harmonics` of each direction, scaled to the fundamental `gamma` g."""

    kind: Literal["seed"]
    harmonics: Annotated[int, Field(ge=1, le=3)] = 3
    gamma: Positive | None = None

    def build(self, directory: Path) -> Waveform:
        full = seed_table_2_2()
        cut = HarmonicWaveform(
            full.horizontal[: self.harmonics], full.vertical[: self.harmonics], full.frequency
        )
        return cut if self.gamma is None else cut.scaled(self.gamma * GRAVITY / full.vertical[0].amplitude)


class HarmonicInput(Section):
    amplitude: Acceleration
    frequency: Frequency
    phase: Angle = -math.pi / 2


class HarmonicsInput(Section):
    """Lists of harmonics, `[[waveform.horizontal]]` and `[[waveform.vertical]]`; A cos(2 pi f t - phase)."""

    kind: Literal["harmonics"]
    frequency: Frequency
    horizontal: tuple[HarmonicInput, ...]
    vertical: tuple[HarmonicInput, ...]

    def build(self, directory: Path) -> Waveform:
        horizontal, vertical = (
            tuple(Harmonic(h.amplitude, h.frequency, h.phase) for h in row)
            for row in (self.horizontal, self.vertical)
        )
        return HarmonicWaveform(horizontal, vertical, self.frequency).aligned()


class MeasuredInput(Section):
    """Accelerations from a CSV file of t, a_x, a_z: one period (`table`) or a record to be fitted."""

    kind: Literal["table", "accelerometer"]
    file: str
    harmonics: Annotated[int, Field(ge=1, le=64)] | None = None
    unit: Literal["m/s^2", "g"] = "m/s^2"

    def build(self, directory: Path) -> Waveform:
        record = read_record(directory / self.file, self.unit)
        if self.kind == "accelerometer":
            return fit_record(record, self.harmonics or 3)[0]
        return from_table(record.t, record.acceleration, harmonics=self.harmonics or 16)


WaveformInput = Annotated[
    SineInput | SawtoothInput | SeedInput | HarmonicsInput | MeasuredInput, Field(discriminator="kind")
]
