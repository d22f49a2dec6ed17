"""Default diffusivities: the reference state to the digit, temperature, pressure and carrier by Fuller's correlation."""

import pytest

from mpm.case.case import Case, load_case
from mpm.physics.diffusion import carrier_ratio, diffusion_volume
from mpm.physics.elements import parse_formula


def gas_case(**gas: object) -> Case:
    return load_case("single_zone", {"gas": gas})


def test_the_reference_state_is_the_base_case() -> None:
    """Fails when the default differs by a digit from the value that all shipped cases were computed with."""
    base = gas_case()
    assert base.gas.diffusivity == dict.fromkeys(("TMA", "H2O", "CH4", "Al(OH)3"), 2.88e-5)
    assert base.gas.scaled == ("TMA", "H2O", "CH4", "Al(OH)3")


def test_temperature_and_pressure() -> None:
    """Fails when D stays 2.88e-5 m2/s in vacuum or in the cold: D ~ T^1.75/p."""
    assert gas_case(pressure="1 torr").gas.diffusivity["TMA"] == pytest.approx(2.88e-5 * 760.0, rel=1e-6)
    assert gas_case(temperature="300 K").gas.diffusivity["TMA"] == pytest.approx(
        2.88e-5 * (300.0 / 473.0) ** 1.75, rel=1e-12
    )


def test_what_is_typed_stays() -> None:
    """Fails when a typed value is scaled, a default for the rest is not, or a resolved case forgets its values."""
    typed = gas_case(pressure="1 torr", diffusivity={"TMA": "1e-5 m^2/s"})
    assert typed.gas.diffusivity["TMA"] == 1e-5 and typed.gas.scaled == ("H2O", "CH4", "Al(OH)3")
    rest = gas_case(pressure="1 torr", diffusivity={"TMA": "1e-5 m^2/s", "default": "2e-5 m^2/s"})
    assert rest.gas.diffusivity["H2O"] == 2e-5 and rest.gas.scaled == ()
    again = load_case(typed.to_dict())
    assert again == typed and again.gas.scaled == ()


@pytest.mark.parametrize(
    ("name", "carrier", "molar_mass", "expected"),
    [  # Fuller's D in both carriers by hand, 298 K and 1 atm: H2O 8.405e-5 over 2.574e-5 m2/s, CH4 6.395e-5 over 2.149e-5
        ("H2O", "He", 4.0026e-3, 3.2649),
        ("CH4", "He", 4.0026e-3, 2.9753),
        ("TMA", "N2", 28.01e-3, 1.0),
    ],
)
def test_ratio_of_carriers(name: str, carrier: str, molar_mass: float, expected: float) -> None:
    """Fails when masses or diffusion volumes of a carrier count wrongly; measured for water: 0.90 cm2/s in He, 0.26 in N2 (308 K)."""
    assert carrier_ratio(gas_case().mechanism.get(name), carrier, molar_mass) == pytest.approx(
        expected, rel=1e-3
    )
    assert gas_case(carrier=carrier).gas.diffusivity[name] == pytest.approx(2.88e-5 * expected, rel=1e-3)


def test_a_carrier_by_its_formula() -> None:
    """Fails when hydrogen, which is no built-in carrier, is not known by its name, or a name that is no formula is guessed."""
    water = gas_case().mechanism.get("H2O")
    assert carrier_ratio(water, "H2", 2.016e-3) == pytest.approx(3.57, rel=0.1)
    assert carrier_ratio(water, "forming gas", 27e-3) is None
    assert (
        diffusion_volume(parse_formula("H2O")) == 13.1
    )  # a molecule of the table, not the sum of its atoms, 10.73
    assert diffusion_volume({"Al": 1.0}) is None
