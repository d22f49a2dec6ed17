"""The table of fields: every field that a run stores has words, a unit and a scale that fits its values."""

import numpy as np
import pytest

from mpm import Reactor, load_case
from mpm.errors import InputError
from mpm.report.fieldnames import (
    FIELDS,
    Limits,
    colour_limits,
    drawable,
    field_name,
    field_values,
    superscript,
)
from tests.cases import COARSE

VECTOR = np.array([[3.0, 4.0, 0.0], [0.0, -2.0, 0.0]])


def test_every_field_of_a_run_is_in_the_table() -> None:
    """Fails when a run stores a field that pictures can only call by its name."""
    reactor = Reactor(
        load_case("single_cycle", {**COARSE, "geometry.cell_width": "8 mm", "time.end": "0.1 s"})
    )
    reactor.run()
    names = [*reactor.fields(), "zone", "layer"]
    assert "velocity" in names and "pressure" in names and "x_N2" in names
    assert [name for name in names if field_name(name).words == "{}"] == []


def test_units_are_those_of_people_and_convert() -> None:
    """Fails when the unit shown is not the field's, or powers are not raised."""
    assert all(entry.factor > 0.0 for entry in FIELDS)
    speed = field_name("velocity")
    assert speed.unit_shown == "cm/s" and 0.035 / speed.factor == pytest.approx(3.5)
    assert field_name("C_TMA").unit_shown == "mol/m\u00b3" and superscript("m^-2") == "m\u207b\u00b2"
    assert field_name("x_TMA").unit_shown == ""


def test_words_name_the_subject() -> None:
    """Fails when a species or site is lost, or an unknown field has no name at all."""
    assert field_name("theta_OAl(CH3)2").label == "coverage of OAl(CH3)2"
    assert (
        field_name("x_A_b").subject == "A_b"
        and field_name("x_").label == "x_"
        and field_name("odd").label == "odd"
    )


def test_scales_fit_the_values() -> None:
    """Fails when a constant gets a scale, a carrier a logarithmic one, four decades are not kept, or rounding of 0 is coloured."""
    x = field_name("x_TMA")
    wide = colour_limits(x, 0.0, 1e-3)
    assert wide.low == pytest.approx(1e-7) and wide == Limits(wide.low, 1e-3, log=True)
    assert colour_limits(x, 1e-5, 1e-3) == Limits(1e-5, 1e-3, log=True)
    assert colour_limits(x, 0.9997, 1.0) == Limits(0.9997, 1.0)
    assert colour_limits(x, 0.0, 0.0).constant and colour_limits(x, 0.5, 0.5 * (1 + 1e-7)).constant
    assert colour_limits(x, 1e-40, 1e-22) == Limits(0.0, 0.0, constant=True)
    theta = field_name("theta_OH")
    assert colour_limits(theta, 0.2, 0.4) == Limits(0.0, 1.0)
    assert colour_limits(theta, 0.0, 1e-20).constant and colour_limits(theta, 1.0, 1.0).constant
    assert colour_limits(field_name("pressure"), 0.01, 45.0) == Limits(0.0, 45.0)
    assert colour_limits(field_name("velocity_x"), -1.0, 3.0) == Limits(-3.0, 3.0)


def test_vectors_are_drawn_by_length_and_by_component() -> None:
    """Fails when the speed or a component is another number, or a wrong name is not answered with the nearest."""
    data = {"x_TMA": np.array([1.0, 2.0], np.float32), "velocity": VECTOR}
    assert field_values(data, "velocity").tolist() == [5.0, 2.0]
    assert field_values(data, "velocity_y").tolist() == [4.0, -2.0]
    assert drawable(data) == ["x_TMA", "velocity", "velocity_x", "velocity_y"]
    with pytest.raises(InputError, match=r"run: field: found 'x_TNA'; accepted: x_TMA, .*did you mean x_TMA"):
        field_values(data, "x_TNA", "run")
