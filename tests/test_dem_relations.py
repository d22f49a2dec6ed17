"""Engineering relations against the seed's printed numbers; no LAMMPS."""

import math
from typing import Any

import numpy as np
import pytest

from mpm.constants import GRAVITY
from mpm.dem.bed import bond_numbers
from mpm.dem.case import load_case
from mpm.dem.cohesion import largest_force, reduced_hamaker, rumpf_force
from mpm.dem.contact import Contact
from mpm.dem.powder import POWDERS, Powder
from mpm.dem.simulate import build
from mpm.errors import InputError
from mpm.physics import conveying, fluidisation
from mpm.physics.gases import ideal_gas_density
from mpm.physics.porous import kozeny_carman

AIR = ideal_gas_density(pressure=101325.0, molar_mass=29e-3, temperature=293.15)
MU = 18e-6


def test_conveying_limits() -> None:
    """16 Hz, Gamma 0.30, 60 deg: 0.538 and 1.690 cm/s; throw number is the Gamma it was made from."""
    z = 0.30 * 9.81 / (2 * math.pi * 16) ** 2
    x = z / math.tan(math.radians(60))
    assert conveying.straight_drop_velocity(x, 16.0) == pytest.approx(0.5380e-2, rel=1e-3)
    assert conveying.perfect_flight_velocity(x, 16.0) == pytest.approx(1.6902e-2, rel=1e-3)
    assert conveying.throw_number(z * (2 * math.pi * 16) ** 2) == pytest.approx(0.30)
    assert conveying.throw_number(0.30 * 9.81, math.radians(9)) == pytest.approx(0.30 * 1.01247, rel=1e-4)
    assert conveying.efficiency(-0.5, 2.0) == 0.25


@pytest.mark.parametrize(
    ("porosity", "surface", "permeability", "constants"),
    [
        (0.46, 0.073e6, 4.25e-12, (4.098, 4.643)),
        (0.37, 0.062e6, 2.76e-12, (4.502, 5.262)),
        (0.68, 0.062e6, 3.66e-12, (21.001, 23.670)),
        (0.40, 0.007e6, 17.93e-12, (61.090, 94.950)),
    ],
)
def test_kozeny_constants_of_table_5_4(
    porosity: float, surface: float, permeability: float, constants: Any
) -> None:
    """Fails when the permeability of table 5.4 does not lie between those of the constants that the rounding of its numbers allows."""
    high, low = (
        kozeny_carman(porosity=porosity, surface_to_volume=surface, constant=constant)
        for constant in constants
    )
    assert low <= permeability <= high


@pytest.mark.parametrize(
    ("name", "ergun46", "wen_yu"),
    [
        ("GL29", 0.0837, 0.0693),
        ("GL56", 0.3202, 0.2585),
        ("GL223", 5.1402, 4.0630),
        ("SS231", 10.2281, 12.8237),
    ],
)
def test_minimum_fluidisation_against_the_reference(name: str, ergun46: float, wen_yu: float) -> None:
    """Reference table umf.csv at a voidage of 0.46 [cm/s]; Gidaspow's drag carries the bed at the same velocity."""
    p = POWDERS[name]

    def ergun(porosity: float) -> float:
        return fluidisation.minimum_fluidisation_velocity(
            diameter=p.diameter, sphericity=p.sphericity, density_solid=p.density, porosity=porosity,
            viscosity=MU, density_gas=AIR, ergun=p.ergun,
        )  # fmt: skip

    velocity = ergun(0.46)
    assert 100 * velocity == pytest.approx(ergun46, rel=1e-3)
    beta = fluidisation.gidaspow_beta(
        np.array(0.46),
        np.array(velocity / 0.46),
        diameter=p.diameter,
        sphericity=p.sphericity,
        viscosity=MU,
        density=AIR,
        ergun=p.ergun,
    )
    weight = (1 - 0.46) * (p.density - AIR) * GRAVITY
    assert float(beta) * velocity / 0.46**2 == pytest.approx(weight, rel=1e-9)
    other = fluidisation.wen_yu_minimum_fluidisation(
        diameter=p.diameter, density_solid=p.density, viscosity=MU, density_gas=AIR
    )
    assert 100 * other == pytest.approx(wen_yu, rel=1e-3)
    # A loose bed (0.40-0.56) reaches the measured value for every powder.
    assert p.measured_umf is not None and ergun(0.40) < p.measured_umf < ergun(0.56)


def test_drag_is_continuous_in_the_slip_and_finite_at_rest() -> None:
    """Fails if the dilute branch divides by a slip of zero or has another limit there."""
    still, slow = (
        fluidisation.gidaspow_beta(
            np.array([0.5, 0.9, 1.0]),
            np.full(3, slip),
            diameter=50e-6,
            sphericity=0.8,
            viscosity=MU,
            density=AIR,
        )
        for slip in (0.0, 1e-9)
    )
    assert still == pytest.approx(slow, rel=1e-3) and still[2] == 0.0
    assert np.isfinite(still).all()


def test_granular_bond_numbers_of_the_seed() -> None:
    """23.8 (24, table 2.1), 19 and 76 (table 3.3); and 307 with the Hamaker constant of section 2.4.4."""

    def bond_number(powder: Powder, *, hamaker: float, radius: float) -> float:
        force = largest_force(hamaker=hamaker, radius=radius, asperity=powder.asperity)
        return fluidisation.granular_bond_number(
            cohesion=force, diameter=powder.diameter, density=powder.density
        )

    gl50, gl56 = POWDERS["GL50"], POWDERS["GL56"]
    for p, expected in ((gl50, 23.8), (gl56, 19.0)):
        found = bond_number(p, hamaker=p.hamaker, radius=p.diameter / 4)
        assert found == pytest.approx(expected, rel=5e-3)
    wall = bond_number(gl56, hamaker=gl56.wall_hamaker, radius=gl56.diameter / 2)
    assert wall == pytest.approx(76.0, rel=5e-3)
    assert (gl50.diameter, gl50.density, gl50.asperity) == (50e-6, 2500, 1e-9)
    assert bond_number(gl50, hamaker=4e-19, radius=12.5e-6) == pytest.approx(307, rel=5e-3)


def test_rumpf_force_is_held_inside_and_ends_outside() -> None:
    s = np.array([-1e-9, 0.0, 0.3e-9, 0.4e-9, 9.9e-9, 10.1e-9])
    f = rumpf_force(s, hamaker=3.1e-20, radius=12.5e-6, asperity=1e-9)
    assert f[0] == f[1] == f[2] > f[3] > f[4] > 0.0 == f[5]
    assert reduced_hamaker(hamaker=3.1e-20, stiffness=25.0, material_stiffness=2500.0) == pytest.approx(
        3.1e-21
    )


def test_mean_free_path_of_the_seed() -> None:
    """About 25 um in N2 at 2 Torr (supplement A)."""
    path = fluidisation.mean_free_path(
        viscosity=17.6e-6, pressure=2 * 133.32, temperature=293.15, molar_mass=28.01e-3
    )
    assert path == pytest.approx(25e-6, rel=0.05)


def test_collision_time_and_damping() -> None:
    """An undamped collision takes pi sqrt(m/k); the damping of (2-5) gives back its restitution."""
    assert Contact(stiffness=3.0, restitution=1.0, friction=0.3).duration(8e-11) == pytest.approx(
        math.pi * math.sqrt(8e-11 / 3.0)
    )
    contact = Contact(stiffness=300.0, restitution=0.83, friction=0.4)
    rate = contact.damping(1.6e-10) / 2 / 1.6e-10
    assert math.exp(-rate * contact.duration(1.6e-10)) == pytest.approx(0.83)


@pytest.mark.parametrize("count", [1, 3, 5, 8])
def test_size_classes_keep_mean_and_spread(count: int) -> None:
    p = POWDERS["GL56"]
    sizes = p.size_classes(count)
    assert sizes.mean() == pytest.approx(p.diameter) and len(sizes) == count
    if count > 1:
        assert sizes.std() == pytest.approx(p.deviation)


@pytest.mark.parametrize("count", [2, 5, 20])
def test_a_distribution_too_wide_for_its_classes_is_refused(count: int) -> None:
    """Fails when sizes below a fifth of the mean are cut off, which shifts the mean asked for, or a spread that fits is refused."""
    case = {
        "powder": {"base": "GL56"},
        "waveform": {"kind": "sine", "gamma": 0.3, "frequency": "16 Hz"},
        "box": {"size_classes": count},
    }
    largest = POWDERS["GL56"].largest_deviation(count)
    sizes = load_case(case, {"powder.deviation": f"{0.999 * largest!r} m"}).diameters()
    assert sizes.mean() == pytest.approx(56e-6) and sizes.std() == pytest.approx(0.999 * largest)
    assert sizes.min() == pytest.approx(0.2 * 56e-6, rel=0.01)
    with pytest.raises(InputError, match=r"powder\.deviation: found .* um beside a mean diameter of 56 um"):
        load_case(case, {"powder.deviation": f"{1.001 * largest!r} m"})


def test_bond_numbers_are_those_of_the_base_that_is_simulated() -> None:
    """GL56 over a frit of 25 um: fails when the flat wall's 76 (the seed's table 3.3) is told of a box whose particles meet 23.5, or the
    scaling with the spring is not told."""
    case = {
        "powder": "GL56",
        "waveform": {"kind": "sine", "gamma": 0.3, "frequency": "16 Hz"},
        "box": {"base": "frit", "frit_diameter": "25 um", "size_classes": 1, "length": 8, "depth": 4},
    }
    found = {
        stiffness: bond_numbers(build(load_case(case, {"box.stiffness": f"{stiffness} N/m"}), 1)[0])
        for stiffness in (3, 30)
    }
    assert found[3]["bond_number_pair"] == pytest.approx(19.0, rel=0.01)
    assert found[3]["bond_number_base"] == pytest.approx(23.5, rel=0.01)
    assert found[3]["simulated_bond_number_base"] == pytest.approx(0.81, rel=0.01)
    assert found[30]["simulated_bond_number_base"] == pytest.approx(2.57, rel=0.01)
    flat = bond_numbers(build(load_case(case, {"box.base": "flat", "box.reduced_cohesion": False}), 1)[0])
    assert flat["bond_number_base"] == flat["simulated_bond_number_base"] == pytest.approx(76.0, rel=0.01)
    none = bond_numbers(build(load_case(case, {"box.cohesion": False}), 1)[0])
    assert set(none.values()) == {0.0}


@pytest.mark.parametrize(
    ("change", "held"),
    [
        ({"box.length": 1e9}, "on 0 glued"),
        ({"box.height": 1e20}, "on 0 glued"),
        (
            {"box.base": "frit", "box.frit_diameter": "1 nm"},
            r"on 1.9e\+11 glued",
        ),  # 12 x 5 times (56 um/1 nm)^2
    ],
)
def test_a_box_that_no_memory_holds_is_refused(change: Any, held: str) -> None:
    """Fails when a slip of a unit fills the memory instead of being named, or the count is not that of the spheres."""
    case = {"powder": "GL56", "waveform": {"kind": "sine", "gamma": 0.3, "frequency": "16 Hz"}}
    with pytest.raises(InputError, match=rf"box: found a box of about .* {held} .* up to 5,000,000"):
        load_case(case, change)
