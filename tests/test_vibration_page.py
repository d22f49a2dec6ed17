"""docs/vibration.md: its tables can be measured again, its theory is exact where it can be, and what it takes for granted holds."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from mpm.case.case import load_case
from mpm.motion.kinematics import BedMotion

from .cases import SHORT, TINY, run, zone

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import vibration  # noqa: E402
from vibration_sections import columns, dispersion, extrapolation, force, readings, store, switches, theory  # noqa: E402

THESIS = ROOT / "cases" / "thesis" / "single_zone.toml"
OMEGA, PEAK, VISCOSITY, DIFFUSIVITY = 32.0 * np.pi, 1.69016765e-2, 1.72e-5 / 0.72167, 2.88e-5


def amplitudes(*values: float) -> theory.Complex:
    """Harmonics of a velocity [m/s]."""
    return np.array(values, dtype=complex)


@pytest.mark.parametrize(
    ("floor", "roof", "height", "expected"),
    [
        (PEAK, PEAK, 5e-3, 0.001808383),
        (PEAK, 0.0, 5e-3, 0.000885429),
        (0.0, PEAK, 1e-2, 0.000442721),
        (2.0 * PEAK, 2.0 * PEAK, 2e-2, 0.001770883),
    ],
)
def test_closed_form(floor: float, roof: float, height: float, expected: float) -> None:
    """Fails when dispersion between walls that move together, or one of them alone, is off Watson's.

    `expected` comes from an independent program, which checks it by finite differences.
    """
    found = theory.watson(
        amplitudes(floor),
        amplitudes(roof),
        omega=OMEGA,
        viscosity=VISCOSITY,
        diffusivity=DIFFUSIVITY,
        height=height,
    )
    assert found == pytest.approx(expected, rel=1e-5)


def test_layers_are_channels_where_nothing_passes() -> None:
    """Fails when the theory of all layers is not Watson's closed form in a channel that is alone."""
    case = load_case(THESIS)
    plenum = theory.layers(case)[0]
    solid, moved, mean = theory.signals(case)
    alone = theory.stack_dispersion([plenum], BedMotion(case.motion).vibration.omega)["plenum"]
    exact = dispersion.watson(store.Lab(), 0.3)["plenum"]
    assert alone == pytest.approx(exact, rel=2e-3)
    assert mean == pytest.approx(0.013, rel=1e-9)
    assert abs(moved[0]) == pytest.approx(PEAK, rel=2e-3) and abs(solid).max() > 0.0


def test_schemes_add_what_their_formulas_say() -> None:
    """Fails when upwinding adds something else than |u| h/2, fitting than a third of its square, a step than u^2 dt/2, for one velocity."""
    speed, along, width = 0.01, 1e-5, 2e-4
    layer = theory.Layer(
        name="gas",
        height=1e-3,
        eps=1.0,
        along=along,
        across=along,
        mean=np.full(theory.ROWS, -speed),
        harmonics=np.zeros((theory.HARMONICS, theory.ROWS), dtype=complex),
    )
    z = speed * width / 2.0 / along
    assert theory.added_by_scheme(layer, width, "upwind") == pytest.approx(z, rel=1e-12)
    assert theory.added_by_scheme(layer, width, "fitted") == pytest.approx(z**2 / 3.0, rel=1e-3)
    assert theory.added_by_steps(layer, 2e-3) == pytest.approx(speed**2 * 1e-3 / along, rel=1e-12)


@pytest.mark.parametrize("order", [0.7, 1.0, 2.0])
def test_extrapolation_is_exact_for_a_power(order: float) -> None:
    """Fails when limit and order of a + b h^p are not found from the three narrowest columns, or a fourth one disturbs them."""
    widths = (2.33, 1.0, 0.34, 0.17)
    values: list[float | None] = [9.9, *(0.01 + 0.02 * h**order for h in widths[1:])]
    found = extrapolation.to_zero(widths, values)
    assert found == pytest.approx((0.01, order), rel=1e-9)


@pytest.mark.parametrize(
    "values", [[0.1, 0.2, 0.1, 0.2], [None, None, 0.2, 0.1], [0.1, 0.1, 0.1, 0.1], [0.4, 0.3, 0.2, 0.0]]
)
def test_no_limit_is_made_up(values: list[float | None]) -> None:
    """Fails when numbers that go no one way, are too few, or do not settle are given a limit."""
    assert extrapolation.to_zero((2.33, 1.0, 0.34, 0.17), values) is None
    assert extrapolation.tends((2.33, 1.0, 0.34, 0.17), values) == "–"


def test_averaged_runs_do_not_know_gamma() -> None:
    """Fails when the averaged run depends on Gamma, for which docs/vibration.md measures one alone."""
    ends = [
        run(zone({**SHORT, "fidelity": "averaged", "motion.gamma": gamma}, TINY))[1] for gamma in (0.3, 0.6)
    ]
    a, b = (result.field("C_TMA") for result in ends)
    assert np.abs(a - b).max() <= 1e-9 * a.max()


def test_a_key_that_nobody_types_makes_no_new_record(tmp_path: Path) -> None:
    """Fails when a run is made twice, when one that changes something finds the other's record, or a missing one is not a dash."""
    said: list[str] = []
    lab = store.Lab(tmp_path, coarse=True, say=said.append)
    first = readings.found(lab, readings.OURS, 1.0, 0.3)
    assert first is not None and readings.found(lab, readings.OURS, 1.0, 0.3) == first and len(said) == 1
    assert readings.found(lab, "upwinding", 1.0, 0.3) != first
    stored = store.Lab(tmp_path, coarse=True, only_stored=True)
    assert readings.found(stored, "upwinding", 1.0, 0.6) is None
    assert store.shown(None, ".3f") == "–"


def shape(text: str) -> list[tuple[list[str], int]]:
    """Heading and number of rows of every table in Markdown."""
    blocks = re.findall(r"(?:^\|.*\n?)+", text, re.MULTILINE)
    split = [block.strip().splitlines() for block in blocks]
    return [([c.strip() for c in lines[0].strip("| ").split(" | ")], len(lines)) for lines in split]


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("dispersion", "added", "steps") else pytest.param(name, marks=pytest.mark.slow)
        for name in vibration.SECTIONS
    ],
)
def test_a_section_measures_its_table(name: str, tmp_path: Path) -> None:
    """Fails when a run of the page no longer works, or its tables have other columns and rows than the page."""
    lab = store.Lab(tmp_path, coarse=True, say=lambda _: None)
    measured = vibration.SECTIONS[name](lab)
    begin, end = vibration.marks(name)
    shown = vibration.document(name).read_text(encoding="utf-8").split(begin)[1].split(end)[0]
    assert shape(measured) == shape(shown)
    assert not re.search(r"\b(nan|inf)\b", measured + shown)


def test_force_of_a_prescribed_flight() -> None:
    """Fails when weight, carried share or gas force of the thesis' flight are not those found by hand, R (U - w)."""
    found = force.pressures(store.Lab(), 0.3)
    resistance, through = 1.72e-5 * 3e-3 / 4.25e-12, 2.0 * 0.035 * 4e-3 / 0.1397
    assert found["weight"] == pytest.approx(0.54 * 2500.0 * 9.81 * 3e-3, rel=1e-9)
    assert found["carried"] == pytest.approx(resistance * through, rel=1e-9)
    assert found["largest"] == pytest.approx(resistance * (through + 0.004 + 0.3 * 9.81 / OMEGA), rel=1e-5)
    assert found["least"] == pytest.approx(resistance * (through + 0.004 - 0.3 * 9.81 / OMEGA), rel=1e-5)


def test_every_switch_is_in_the_table() -> None:
    """Fails when a switch of the preset is missing from docs/conventions.md's table, or a reading types a key that is none."""
    from mpm.case.conventions import CLOSED_CODE

    alone = {key for changes in switches.SWITCHES.values() for key in changes}
    assert set(CLOSED_CODE) <= alone
    typed = {key for reading in readings.READINGS.values() for key in reading}
    assert typed <= {*CLOSED_CODE, "conventions"}
    assert set(columns.NUMERICS) == {"ours", "upwinding", "closed-code"}


def cells(name: str, table: int = 0) -> list[list[str]]:
    """Cells of a table of the page that a section has written."""
    begin, end = vibration.marks(name)
    text = vibration.document(name).read_text(encoding="utf-8").split(begin)[1].split(end)[0]
    block = re.findall(r"(?:^\|.*\n?)+", text, re.MULTILINE)[table]
    return [[c.strip() for c in line.strip("| ").split(" | ")] for line in block.strip().splitlines()]


def column(name: str, row: str, head: str, table: int = 0) -> float:
    """The first number of a cell, by the beginning of its row and the last column of exactly that heading."""
    found = cells(name, table)
    line = next(line for line in found if " ".join(line).startswith(row))
    at = max(i for i, text in enumerate(found[0]) if text == head)
    return float(line[at].split()[0])


def test_the_answer_is_that_of_the_tables() -> None:
    """Fails when tables have been measured again and the words above them tell older numbers."""
    fitted, upwind = (column("readings", row, "gain") for row in ("ours", "upwinding"))
    preset = column("readings", '`conventions = "closed-code"`', "Gamma 0.3")
    level = preset - column("readings", "ours", "Gamma 0.3")
    plain, dispersed = (column("models", f"{row} 0.", "Gamma 0.6") for row in ("steady", "steady + K"))
    words = [
        (r"vibration adds \*\*([\d.]+) %\*\*", column("dispersion", "0.3", "bed"), 0.05),
        (r"at 0.6 \*\*([\d.]+) %\*\*", column("dispersion", "0.6", "bed"), 0.05),
        (r"upwinding adds (\d+) and \d+ %", column("added", "0.3 bed", "upwinding"), 0.5),
        (r"upwinding adds \d+ and (\d+) %", column("added", "0.6 bed", "upwinding"), 0.5),
        (r"raises that coverage by \*\*([\d.]+)\*\*", upwind, 6e-5),
        (r"exponentially fitted fluxes by \*\*([\d.]+)\*\*", fitted, 6e-5),
        (r"change the coverage by ([\d.]+\d)", level, 6e-4),
        (r"before the inlet by [\d.]+ to (\d\.\d+)", dispersed - plain, 6e-5),
        (r"gas forces from −(\d+) to", -float(cells("force")[2][3].split()[0]), 0.5),
    ]
    text = re.sub(r"\s+", " ", vibration.ANSWER.read_text(encoding="utf-8"))
    for pattern, measured, within in words:
        said = re.search(pattern, text)
        assert said is not None, pattern
        assert float(said[1]) == pytest.approx(measured, abs=within), pattern


def over_time(conventions: str, state: str) -> dict[str, str]:
    """A row of the gains at the thesis' columns over time, of docs/reproduction.md, by heading."""
    text = (ROOT / "docs" / "reproduction.md").read_text(encoding="utf-8")
    _, _, section = text.partition("columns, over time\n")
    lines = [
        [c.strip() for c in line.strip("| ").split(" | ")]
        for line in section.splitlines()
        if line.startswith("| ")
    ]
    line = next(line for line in lines if line[:2] == [conventions, state])
    return dict(zip(lines[0], line, strict=True))


def test_gains_over_time_are_those_of_the_reproduction() -> None:
    """Fails when R8 has been measured again at the thesis' columns and docs/vibration.md tells older gains, times or verdicts of it."""
    text = re.sub(r"\s+", " ", vibration.ANSWER.read_text(encoding="utf-8"))
    sentences = {
        "developed": r"developed\): ([\d.]+) to ([\d.]+) with our conventions, ([\d.]+) to ([\d.]+) with",
        "start-up": r"impulsive start: ([\d.]+) to ([\d.]+) with ours, ([\d.]+) to ([\d.]+) with",
        "developed, inlets in the lab's frame": r"in the lab: ([\d.]+) to ([\d.]+) with ours, ([\d.]+) to ([\d.]+) with",
    }
    full = re.search(r"fills up, at ([\d.]+ s) and ([\d.]+ s)", text)
    assert full is not None
    for state, pattern in sentences.items():
        said = re.search(pattern, text)
        assert said is not None, pattern
        for conventions, least, most, when in zip(
            ("mpm", "closed code"), said.groups()[::2], said.groups()[1::2], full.groups(), strict=True
        ):
            row = over_time(conventions, state)
            gains = [float(row[f"{second} s"].split()[0]) for second in range(5, 10)]
            assert [f"{min(gains):.4f}", f"{max(gains):.4f}"] == [least, most], (state, conventions)
            assert row["full"] == when
            assert row["20 s"] == "–" or float(row["20 s"].split()[0]) == 0.0
            assert float(row["gains"].split()[1]) >= 9.0
            times = [float(time) for time in re.findall(r"(\d+\.\d)(?= s| to)", row["above its mesh error"])]
            if conventions == "mpm" or state == "start-up":
                assert times[0] == 5.0 and (times[-1] >= 9.0 if state == "start-up" else times[-1] <= 6.0)
            margin = [float(m) for m in re.findall(r"\d\.\d{4}", row["above its mesh error"])]
            assert max(margin) <= 0.005 or state == "start-up"
    assert "-0.0021" in over_time("mpm", "start-up")["1.925 s"] and "0.0021: gas" in text
