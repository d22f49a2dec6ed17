"""The gas as a mixture: laws of its properties, and runs in which density, viscosity and diffusivities follow the composition."""

import numpy as np
import pytest

from mpm.advice.idle import idle_keys
from mpm.constants import GAS_CONSTANT
from mpm.errors import InputError
from mpm.physics.mixture import diffusivity_ratio, mass_ratio, viscosity_ratio
from mpm.physics.substances import Species
from mpm.reactor.reactor import Reactor

from .cases import HEATED, MPI, TINY, assert_heat_balances, column_case, run, zone

N2 = 28.01e-3
HE = Species("He", 4.0026e-3, {"He": 1.0}, viscosity=1.99e-5)
HEAVY = Species("SF6", 146.06e-3, {"S": 1.0, "F": 6.0}, viscosity=1.5e-5)
TRACER = {
    "mechanism": "inline",
    "species": {"SF6": {"molar_mass": "146.06 g/mol", "viscosity": "1.5e-5 Pa s"}},
}
BLOCK = {
    "porosity": 0.4,
    "permeability": "1 um^2",
    "surface_to_volume": "0 1/m",
    "tortuosity_factor": 2.0,
    "density": "2000 kg/m^3",
    "heat_capacity": "800 J/kg/K",
    "conductivity": "1 W/m/K",
}


def test_molar_mass_and_viscosity_of_a_mixture() -> None:
    """Fails when a limit is off, or Wilke's formula: helium in nitrogen is thicker than either (his minimum of phi)."""
    x = np.array([0.0, 0.5, 1.0])
    np.testing.assert_allclose(mass_ratio([HE], N2, {"He": x}), (N2 * (1 - x) + 4.0026e-3 * x) / N2)
    ratio = np.asarray(viscosity_ratio([HE], N2, 1.79e-5, {"He": x}))
    assert ratio[0] == pytest.approx(1.0) and ratio[2] == pytest.approx(1.99 / 1.79)
    phi = [
        (1 + np.sqrt(a / b) * (n / m) ** 0.25) ** 2 / np.sqrt(8 * (1 + m / n))
        for a, b, m, n in ((1.79, 1.99, N2, 4.0026e-3), (1.99, 1.79, 4.0026e-3, N2))
    ]
    assert ratio[1] == pytest.approx((1.79 / (1 + phi[0]) + 1.99 / (1 + phi[1])) / 1.79)
    assert viscosity_ratio([Species("X", 0.1, {})], N2, 1.79e-5, {"X": x}) == pytest.approx(1.0)


def test_diffusivity_in_a_mixture() -> None:
    """Fails when Blanc's law or Fuller's ratio is off: alone in the carrier nothing changes, among light molecules it diffuses faster."""
    none = np.zeros(1)
    assert diffusivity_ratio("SF6", [HE, HEAVY], "N2", N2, {"SF6": none + 0.3}) == pytest.approx(1.0)
    half = diffusivity_ratio("SF6", [HE, HEAVY], "N2", N2, {"SF6": none, "He": none + 0.5})
    masses = (1 / 146.06e-3 + 1 / N2) / (1 / 146.06e-3 + 1 / 4.0026e-3)
    sizes = (np.cbrt(71.3) + np.cbrt(2.67)) / (np.cbrt(71.3) + np.cbrt(18.5))
    assert half == pytest.approx(1.0 / (0.5 + 0.5 * np.sqrt(masses) * sizes**2))


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_density_and_pressure_drop_of_a_heavy_feed(fidelity: str) -> None:
    """Fails when the flow does not see the composition: a column full of the feed has rho = p M/(R T) and dp = mu u h/K of the mixture."""
    case = column_case(
        *(5e-3, 4, 0.05, BLOCK),
        fidelity=fidelity,
        inlet={"mass_fractions": {"SF6": 0.7}},
        chemistry=TRACER,
        gas={"temperature": "400 K", "mixture": True},
        energy={"buoyancy": False},
        motion={"gamma": 0.0, "bed_velocity": "0 m/s", "start": "0 s"},
        time={"end": "1 s", "step": "10 ms"},
        output={"every": "0.5 s"},
    )
    reactor = Reactor(case, MPI.COMM_SELF)
    result = reactor.run(callback=assert_heat_balances)
    x = (0.7 / 146.06) / (0.7 / 146.06 + 0.3 / 28.01)
    np.testing.assert_allclose(result.field("x_SF6"), x, rtol=1e-9)
    mass = x * 146.06e-3 + (1 - x) * 28.01e-3
    density = case.gas.pressure * mass / (GAS_CONSTANT * 400.0)
    np.testing.assert_allclose(result.field("density"), density, rtol=1e-4)
    thick = np.asarray(
        viscosity_ratio(case.mechanism.species, N2, case.gas.viscosity, {"SF6": np.array([x])})
    )
    expected = case.gas.viscosity * thick[0] * 0.05 * 5e-3 / 1e-12
    within = 1e-3 if fidelity == "steady" else 0.01  # until it changes by more the flow is not found anew
    assert result.summary["flow"]["pressure_drop"]["packing"] == pytest.approx(expected, rel=within)


def test_dilute_species_hardly_change_a_mixture() -> None:
    """Fails when a mixture with next to nothing in it is another gas: coverage and temperatures agree to what is in it."""
    fields = []
    for mixture in (False, True):
        case = zone({**HEATED, "time.end": "0.5 s", "output.every": "0.25 s", "gas.mixture": mixture}, TINY)
        fields.append(run(case)[1])
    for name in ("temperature", "x_TMA"):
        one, other = fields[0].field(name), fields[1].field(name)
        np.testing.assert_allclose(other, one, rtol=0.0, atol=3e-3 * np.abs(one).max())
    assert np.abs(fields[1].field("density") / fields[0].field("density") - 1.0).max() > 1e-5


def test_viscosity_of_a_species_counts_in_a_mixture_alone() -> None:
    """Fails when a key that nothing reads is not called idle."""
    key = "chemistry.species.TMA.viscosity"
    for changes, idle in (
        ({}, True),
        ({"energy.soret": False}, True),
        ({"energy.soret": False, "gas.mixture": True}, False),
    ):
        told = " ".join(idle_keys(zone({key: "1e-5 Pa s", **changes}, TINY)))
        assert (key in told) == idle, told


def test_mixture_needs_energy() -> None:
    """Fails when the option is taken where nothing reads it."""
    with pytest.raises(InputError, match=r"gas\.mixture: found true in a case without a table \[energy\]"):
        zone({"gas.mixture": True}, TINY)
