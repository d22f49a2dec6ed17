"""Waveforms and accelerometer fits: exact shapes and known signals; no LAMMPS."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.dem import waveform as wf
from mpm.dem.accelerometer import fit_channel, fit_record, read_record, spectrum
from mpm.errors import InputError


def derivative(values: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.gradient(values, t, axis=1)[:, 1:-1]


@pytest.mark.parametrize(
    "wave",
    [
        wf.sine(gamma=0.3, frequency=16.0, angle=math.pi / 3),
        wf.seed_table_2_2(),
        wf.Sawtooth(horizontal=113e-6, vertical=80e-6, frequency=48.0),
    ],
    ids=["sine", "table 2.2", "sawtooth"],
)
def test_velocity_and_acceleration_are_derivatives(wave: Any) -> None:
    """Fails if displacement, velocity and acceleration do not belong to one motion."""
    t = np.linspace(0.0, 1.0 / wave.frequency, 20001)
    v, a = wave.velocity(t), wave.acceleration(t)
    assert np.abs(derivative(wave.displacement(t), t) - v[:, 1:-1]).max() < 1e-3 * np.abs(v).max()
    error = np.abs(derivative(v, t) - a[:, 1:-1]).max(axis=0)
    assert np.sort(error)[:-6].max() < 1e-3 * np.abs(a).max()  # the sawtooth's acceleration jumps twice


def test_sine_follows_the_conventions_of_the_reactor() -> None:
    """Gamma 0.30, 16 Hz, 60 deg from the horizontal: A_x 0.168 mm, A_y 0.291 mm, displacement A sin(phase)."""
    wave = wf.sine(gamma=0.30, frequency=16.0, angle=math.radians(60))
    phase = np.linspace(0, 2 * np.pi, 50)
    d = wave.displacement(phase / (2 * np.pi * 16.0))
    assert d[1] == pytest.approx(0.3 * 9.81 / (2 * np.pi * 16) ** 2 * np.sin(phase), abs=1e-12)
    assert wf.peak_displacement(wave) == pytest.approx((0.168e-3, 0.291e-3), rel=3e-3)
    other = wf.sine(gamma=0.30, frequency=16.0, angle=math.radians(60), angle_from="vertical")
    assert wf.peak_displacement(other)[0] / wf.peak_displacement(other)[1] == pytest.approx(math.sqrt(3))


def test_sawtooth_satisfies_its_constraints() -> None:
    """(2-10), (2-11): equal displacement, continuous velocity, 3/4 of the cycle out; 2.27 cm/s out at 113 um."""
    saw = wf.Sawtooth(horizontal=113e-6, vertical=113e-6, frequency=48.0)
    assert 1 / saw.extension_frequency + 1 / saw.retraction_frequency == pytest.approx(2 / 48.0)
    assert wf.extension_velocity(saw) == pytest.approx(2.27e-2, rel=3e-3)
    t = np.arange(40000) / 40000 / 48.0
    v = saw.velocity(t)[0]
    assert np.abs(np.diff(v)).max() < 1e-3 * np.abs(v).max()  # no jump anywhere, the seam included
    assert (v > 0).mean() == pytest.approx(0.75, abs=1e-3)
    assert wf.peak_displacement(saw)[0] == pytest.approx(113e-6, rel=1e-6)
    assert saw.displacement(np.zeros(1)) == pytest.approx(0.0) and saw.velocity(np.zeros(1))[1] > 0


def test_seed_waveform_limits() -> None:
    """Straight drop 1.08 cm/s and perfect flight 3.51 cm/s of section 2.4.2, and the alignment."""
    wave = wf.seed_table_2_2()
    first = wf.HarmonicWaveform(wave.horizontal[:1], wave.vertical[:1], 48.0)
    assert 2 * wf.peak_displacement(first)[1] * 48.0 == pytest.approx(1.08e-2, rel=5e-3)
    assert wf.extension_velocity(first) == pytest.approx(3.51e-2, rel=1e-3)
    assert first.displacement(np.zeros(1)) == pytest.approx(0.0, abs=1e-12)
    assert (first.velocity(np.zeros(1)) > 0).all()


def test_table_reproduces_a_waveform_from_uneven_samples() -> None:
    """Fails if the resampling, the signs or the alignment of a tabulated period are wrong."""
    wave = wf.HarmonicWaveform(
        (wf.Harmonic(amplitude=3.0, frequency=20.0), wf.Harmonic(amplitude=1.0, frequency=60.0, phase=0.4)),
        (wf.Harmonic(amplitude=5.0, frequency=20.0),),
        20.0,
    )
    rng = np.random.default_rng(3)
    t = np.sort(np.r_[0.0, rng.uniform(0, 0.05, 400), 0.05])
    table = wf.from_table(t, wave.acceleration(t))
    probe = np.linspace(0, 0.1, 77)
    assert table.frequency == pytest.approx(20.0)
    assert table.acceleration(probe) == pytest.approx(wave.acceleration(probe), abs=5e-3)
    assert table.displacement(probe) == pytest.approx(wave.displacement(probe), abs=1e-7)


def noisy_record(path: Path, unit: float = 1.0) -> wf.HarmonicWaveform:
    """A synthetic accelerometer: table 2.2's harmonics, uneven 1.6 kHz sampling, gravity offset and noise."""
    rng = np.random.default_rng(7)
    t = np.cumsum(rng.normal(1 / 1600, 2e-5, 3000))
    wave = wf.seed_table_2_2()
    a = wave.acceleration(t) + rng.normal(0, 0.5, (2, t.size)) + np.array([[0.0], [9.81]])
    np.savetxt(path, np.column_stack([t, *(a / unit)]), delimiter=",", header="t,a_y,a_z", comments="")
    return wave


def test_accelerometer_fit_recovers_the_harmonics(tmp_path: Path) -> None:
    """Amplitudes to 2 %, frequencies to 0.02 Hz; the raw FFT amplitude is too small and is corrected."""
    wave = noisy_record(tmp_path / "data.csv")
    record = read_record(tmp_path / "data.csv")
    fitted, along, vertical = fit_record(record, 3)
    assert fitted.frequency == pytest.approx(48.0, abs=0.02)
    amplitude = {round(h.frequency): h.amplitude for h in vertical.harmonics}
    assert amplitude == {
        48: pytest.approx(10.273, rel=0.02),
        192: pytest.approx(10.114, rel=0.02),
        167: pytest.approx(9.154, rel=0.02),
    }
    assert all(0.99 < c < 1.25 for c in vertical.correction) and max(vertical.correction) > 1.02
    assert vertical.explained > 0.99
    t = np.linspace(0.0, 0.1, 400)
    main = wf.HarmonicWaveform(
        tuple(h for h in fitted.horizontal if abs(h.frequency - 48) < 1), fitted.vertical, 48.0
    )
    assert main.displacement(t)[0] == pytest.approx(wave.displacement(t)[0], abs=3e-6)
    assert along.harmonics[0].amplitude == pytest.approx(10.581, rel=0.01)


def test_units_of_g(tmp_path: Path) -> None:
    noisy_record(tmp_path / "g.csv", unit=9.81)
    record = read_record(tmp_path / "g.csv", "g")
    assert fit_channel(record.t, record.acceleration[0], 1).harmonics[0].amplitude == pytest.approx(
        10.581, rel=0.02
    )


def test_spectrum_of_a_sine_on_a_bin() -> None:
    n = 1024
    f, a = spectrum(1e-3, 2.5 * np.sin(2 * np.pi * 125.0 * np.arange(n) * 1e-3))
    assert f[np.argmax(a)] == pytest.approx(125.0) and a.max() == pytest.approx(2.5, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,a,b\n1,2,3\n", "samples"),
        ("t,a,b\n" + "0,1,2\n" * 40, "distinct"),
        ("t,a,b\n" + "".join(f"{i},1\n" for i in range(40)), "columns"),
        ("t,a,b\n" + "".join(f"{i},1,x\n" for i in range(40)), "numbers"),
        ("t,a,b\n" + "".join(f"{i},1,nan\n" for i in range(40)), "finite"),
    ],
)
def test_bad_records_are_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as info:
        read_record(path)
    assert "\n" not in str(info.value) and "bad.csv" in str(info.value)


def written(
    path: Path, columns: np.ndarray, separator: str = ",", comma: bool = False, header: str = "t,a,b\n"
) -> Path:
    """A record of 48 Hz with these columns' texts; decimal commas on request."""
    rows = [separator.join(f"{value:.6f}" for value in row) for row in columns.T]
    text = "\n".join(rows)
    path.write_text(header + (text.replace(".", ",") if comma else text) + "\n")
    return path


@pytest.fixture
def columns() -> np.ndarray:
    t = np.arange(400) / 4000.0
    return np.array([t, 3.0 * np.cos(2 * np.pi * 48 * t), 5.5 * np.sin(2 * np.pi * 48 * t)])


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("comma", [False, True])
def test_decimal_commas_are_read_or_refused(
    tmp_path: Path, columns: np.ndarray, separator: str, comma: bool
) -> None:
    """Fails when a decimal comma is taken for a separator, so that times or accelerations are wrong by powers of ten."""
    path = written(tmp_path / "r.csv", columns, separator, comma, separator.join("tab") + "\n")
    if comma and separator == ",":
        with pytest.raises(InputError, match="decimal comma"):
            read_record(path)
        written(path, columns, separator, comma, "")
        with pytest.raises(InputError, match="decimal comma"):
            read_record(path)
        return
    record = read_record(path)
    assert record.t[-1] == pytest.approx(columns[0, -1])
    assert record.acceleration == pytest.approx(
        columns[1:] - columns[1:].mean(axis=1, keepdims=True), abs=2e-6
    )


def test_quoted_and_mixed_decimal_marks(tmp_path: Path, columns: np.ndarray) -> None:
    """Fails when quoted decimal commas are not read, or commas of thousands beside decimal points are read as decimals."""
    path = tmp_path / "r.csv"
    rows = [",".join('"' + f"{value:.6f}".replace(".", ",") + '"' for value in row) for row in columns.T]
    path.write_text("t,a,b\n" + "\n".join(rows) + "\n")
    assert read_record(path).t[-1] == pytest.approx(columns[0, -1])
    for text in ("1,000.5", "1,000,000", "1_000"):
        path.write_text("".join(f"{i};{text};2\n" for i in range(40)))
        with pytest.raises(InputError, match="expected numbers"):
            read_record(path)
    path.write_text("".join(f"{i}.5;1,5;2\n" for i in range(40)))
    with pytest.raises(InputError, match="decimal comma"):
        read_record(path)


def test_units_of_a_header_hold(tmp_path: Path, columns: np.ndarray) -> None:
    """Fails when milliseconds are read as seconds, or a header that contradicts the unit given is passed over."""
    scaled = columns * np.array([[1e3], [1.0], [1.0]])
    record = read_record(written(tmp_path / "r.csv", scaled, header="time (ms),a_y,a_z\n"))
    assert record.t[-1] == pytest.approx(columns[0, -1])
    for header, unit in (("t [s],a_y [g],a_z [g]\n", "m/s^2"), ("t,a_y_m/s2,a_z_m/s2\n", "g")):
        path = written(tmp_path / "r.csv", columns, header=header)
        with pytest.raises(InputError, match="the header says"):
            read_record(path, unit)
        assert len(read_record(path, "g" if unit == "m/s^2" else "m/s^2").t) == 400
