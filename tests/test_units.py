"""Conversion at the door: exact, checked for dimension and range, and reversible."""

import math
import random
import subprocess
import sys
from decimal import Decimal

import pint
import pytest
from pydantic_core import PydanticCustomError

from mpm.metric import METRIC, in_metric
from mpm.units import Dimension, is_counted, parse

SPEED = Dimension("m/s", "a speed", "3.5 cm/s", at_least=0.0)
DEADLINE = Dimension("s", "a time", "5 s", above=0.0, infinite=True)
FRACTION = Dimension("", "a fraction", "0.46", above=0.0, below=1.0)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("139.7 mm", "m", 0.1397),  # binary arithmetic would give the neighbouring float
        ("3.5 cm/s", "m/s", 0.035),
        ("-0.40 cm/s", "m/s", -0.004),
        ("16Hz", "Hz", 16.0),
        ("1e3m", "m", 1000.0),
        (" 4.25 um^2 ", "m^2", 4.25e-12),
        ("4.25 µm²", "m^2", 4.25e-12),
        ("58000 1/m", "1/m", 58000.0),
        ("1.72e-5 Pa s", "Pa*s", 1.72e-5),
        ("200 degC", "K", 473.15),
        ("1 atm", "Pa", 101325.0),
        ("1.0 m^3/kmol/s", "m^3/mol/s", 1e-3),
        ("6.92e-11 kmol/m^2", "mol/m^2", 6.92e-8),
        ("871 J/(kg K)", "J/kg/K", 871.0),
        ("60 deg", "rad", math.radians(60.0)),
        ("0.5 turn", "rad", math.pi),
        ("1 Torr", "Pa", 101325.0 / 760.0),
        ("5 mTorr", "Pa", 101325.0 / 152000.0),
        ("1 torr", "Pa", 101325.0 / 760.0),
        ("1 mbar", "Pa", 100.0),
        ("1 micron", "m", 1e-6),
        ("5 min", "s", 300.0),
        ("2.5 g/cc", "kg/m^3", 2500.0),
        ("200 °C", "K", 473.15),
        ("200 ºC", "K", 473.15),  # ordinal indicator, on Spanish and Italian keyboards
        ("200 ˚C", "K", 473.15),  # ring above
        ("200℃", "K", 473.15),
        ("392 °F", "K", 473.15),
        ("60°", "rad", math.radians(60.0)),
        ("60º", "rad", math.radians(60.0)),
        ("3 \u00b5m", "m", 3e-6),  # micro sign
        ("3 \u03bcm", "m", 3e-6),  # Greek mu
        ("58000 m⁻¹", "1/m", 58000.0),
        ("1.72e-5 Pa·s", "Pa*s", 1.72e-5),
        ("1e999999999999999999 cm", "m", math.inf),  # beyond the exponents of decimals, metric or not
        ("1e9999999 ft", "m", math.inf),
        ("-1e9999999 degC", "K", -math.inf),
        ("−0.40\u202fcm/s", "m/s", -0.004),  # minus sign, narrow space that does not break
    ],
)
def test_conversion_is_exact(text: str, unit: str, value: float) -> None:
    assert parse(text, unit) == pytest.approx(value, rel=1e-15 if unit == "rad" else 0.0, abs=0.0)
    assert is_counted(text, unit)


def test_metric_units_are_those_of_pint() -> None:
    """Fails when a unit that is read without pint becomes another float than pint makes of it, or one that pint does not know so."""
    registry, some = pint.UnitRegistry(non_int_type=Decimal, cache_folder=None), random.Random(1)
    derived = [
        "um^2",
        "1/cm",
        "mm/s",
        "m^3/kmol/s",
        "g/cm^3",
        "Pa s",
        "mPa*s",
        "kJ/mol",
        "mmol/cm^2",
        "J/g/K",
        "m^-1",
        "1/s",
    ]
    bases = [
        "m",
        "s",
        "kg",
        "mol",
        "K",
        "Pa",
        "J",
        "W",
        "N",
        "m^2",
        "1/m",
        "m/s",
        "m^3/mol/s",
        "kg/m^3",
        "Pa*s",
        "J/mol",
        "mol/m^2",
    ]
    read = 0
    for symbol in [*METRIC, *derived]:
        for unit in [*bases, "Hz", "J/kg/K"]:
            number = f"{some.uniform(-1.0, 1.0) * 10.0 ** some.randint(-12, 12):.{some.randint(1, 17)}g}"
            found = in_metric(number, symbol, unit)
            if found is not None:
                assert found == float(registry.Quantity(Decimal(number), symbol).to(unit).magnitude), symbol
                read += 1
    assert read > len(METRIC)


def test_a_case_is_read_without_loading_pint() -> None:
    """Fails when a unit of a built-in case is not read as a metric one: every verb would begin half a second later."""
    for case in ("single_zone", "single_cycle"):
        program = f"import sys, mpm; mpm.load_case({case!r}); sys.exit('pint' in sys.modules)"
        assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


@pytest.mark.parametrize(
    ("text", "unit", "reason"),
    [
        ("5", "m", "no unit"),
        ("five mm", "m", "no number"),
        ("", "m", "no number"),
        ("5 s", "m", "time"),
        ("5 mmm", "m", "unknown unit"),
        ("5 m +", "m", "unknown unit"),
        ("2*3 m", "m", "unknown unit"),  # an expression is not evaluated
        ("960 rpm", "Hz", "angular"),  # pint would make it 100.5 Hz
        ("100 rad/s", "Hz", "angular"),
        ("1 Hz", "rad", "dimension"),
        ("200 C", "K", 'degrees Celsius are "degC"'),
        ("200 F", "K", 'degrees Fahrenheit are "degF"'),
        ("100 sccm", "m/s", "velocity flow/"),
        ("1 slm", "m/s", "velocity flow/"),
        ("3,5 cm/s", "m/s", "decimal sign is a point"),
        ("4.25 um2", "m^2", r"powers are written um\^2"),
        ("2.5 g/cm3", "kg/m^3", r"powers are written g/cm\^3"),
        ("58000 m-1", "1/m", r"powers are written m\^-1"),
        ("58000 /m", "1/m", 'is written "1/m"'),
        ("1 TORR", "Pa", 'did you mean "torr"?'),
        ("1 kpa", "Pa", 'did you mean "kPa"?'),
        ("16 hz", "Hz", 'did you mean "Hz"?'),
        ("200 Celsius", "K", 'did you mean "°C"?'),
        ("200 deg C", "K", 'degrees Celsius are "degC"'),
        ("473 Kelvin", "K", 'did you mean "K"?'),
        ("473 k", "K", 'kelvins are "K"'),
        ("20 SCCM", "m/s", "velocity flow/"),
        ("20 ml/min", "m/s", "velocity flow/"),
        ("2 L/min", "m/s", "velocity flow/"),
        ("1 A", "m", '"angstrom"'),
        ("28 amu", "kg/mol", '"g/mol"'),
        ("0.2 eV", "J/mol", '"96.485 kJ/mol"'),
        ("1 Pas", "Pa*s", '"Pa s"'),
        ("4.2 1/nm^2", "mol/m^2", '"1.6605e-6 mol/m\\^2"'),
    ],
)
def test_what_is_no_quantity_is_refused(text: str, unit: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        parse(text, unit)
    assert not is_counted(text, unit)


@pytest.mark.parametrize("unit", ["m", "m/s", "Pa*s", "m^3/mol/s", "rad", "K", "mol/m^2", "kg/mol", "J/kg/K"])
@pytest.mark.parametrize("number", [0.1, 1.0 / 3.0, math.pi / 3.0, 6.92e-8, 1e30, 1.2345678901234567e-30])
def test_what_is_written_reads_back_as_the_same_float(unit: str, number: float) -> None:
    dimension = Dimension(unit, "a quantity", "")
    assert dimension.read(dimension.write(number)) == number


@pytest.mark.parametrize(
    "value", ["-1 mm/s", "nan m/s", "inf m/s", 3.5, True, None, ["1 m/s"], {"value": 1}, "1 m"]
)
def test_range_and_type_are_checked(value: object) -> None:
    with pytest.raises(
        PydanticCustomError, match=r'accepted: a speed from 0 m/s with its unit, e\.g\. "3\.5 cm/s"'
    ):
        SPEED.read(value)


@pytest.mark.parametrize("value", ["1e31 m/s", "1e-31 m/s", "1e400 m/s", "1e300 km/s"])
def test_sizes_that_no_quantity_has_are_refused(value: str) -> None:
    """Fails when a slip of the exponent is let through to products that overflow or vanish."""
    with pytest.raises(PydanticCustomError, match=r"1e-30 to 1e\+30 m/s|accepted"):
        SPEED.read(value)
    assert SPEED.read("0 m/s") == 0.0


def test_infinity_is_accepted_only_where_it_means_something() -> None:
    assert DEADLINE.read("inf s") == math.inf
    assert DEADLINE.read(DEADLINE.write(math.inf)) == math.inf
    with pytest.raises(PydanticCustomError):
        DEADLINE.read("-inf s")


@pytest.mark.parametrize(
    ("value", "good"), [(0.46, True), (1, False), (0.0, False), ("0.46", False), (False, False)]
)
def test_pure_numbers_are_bare(value: object, good: bool) -> None:
    if good:
        assert FRACTION.read(value) == value
    else:
        with pytest.raises(PydanticCustomError):
            FRACTION.read(value)
