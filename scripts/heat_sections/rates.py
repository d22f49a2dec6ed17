"""What rate constants that follow temperature do to one cycle at 423, 473 and 523 K, all at one temperature."""

from __future__ import annotations

import math
from typing import Any

from heat_sections.store import STEADY, Numbers, both, case_of, markdown, measured_on, run
from mpm.advice.checks import check_case
from mpm.constants import AVOGADRO, GAS_CONSTANT

TEMPERATURES = (423.0, 473.0, 523.0)  # K
MEASURED = ((573.15, 3e-23), (373.15, 1e-24))
"""K and m2: cross section of a methyl group for water at full coverage, Vandalon and Kessels, J. Vac. Sci. Technol. A 35, 05C313 (2017),
abstract: 3e-19 cm2 at 300 degC, 1e-20 cm2 at 100 degC (3e-21 cm2 there when 60 % of the groups are left)."""
ACTIVATION = (
    GAS_CONSTANT * math.log(MEASURED[0][1] / MEASURED[1][1]) / (1.0 / MEASURED[1][0] - 1.0 / MEASURED[0][0])
)
"""J/mol between these two."""
PREFACTOR = MEASURED[0][1] * math.exp(ACTIVATION / (GAS_CONSTANT * MEASURED[0][0]))
WATER = "chemistry.reaction.water"
SITES, GROUPS = 6.92e-8, 2.0  # mol/m2 of the base case; sites that one event of the water reaction takes


def measured(times: float) -> dict[str, Any]:
    """Water that reacts as measured, on so many times the sites: sigma n_s N_A is the share of collisions, an event takes two sites."""
    return {
        f"{WATER}.sticking": PREFACTOR * times * SITES * AVOGADRO / GROUPS,
        f"{WATER}.b": 0.0,
        f"{WATER}.Ea": f"{ACTIVATION!r} J/mol",
    }


RATES: dict[str, dict[str, Any]] = {
    "as shipped: one collision in 100, k ~ √T": {},
    "the same at 473 K, water with 30 kJ/mol": {
        f"{WATER}.A": f"{1.9 * math.exp(ACTIVATION / (GAS_CONSTANT * 473.0))!r} m/s",
        f"{WATER}.b": 0.0,
        f"{WATER}.Ea": f"{ACTIVATION!r} J/mol",
    },
    "water as measured, with 30 kJ/mol": measured(1.0),
    "the same, one site per 24 Å², 100 times the doses": {
        **measured(100.0),
        "material.glass_beads.site_density": f"{100.0 * SITES} mol/m^2",
        "geometry.inlet.tma.mass_fractions.TMA": 2e-2,
        "geometry.inlet.water.mass_fractions.H2O": 7.5e-3,
    },
}
COLUMNS = (
    ("titration.tma.exit_min", "TMA zone, worst row", 1.0, ".4f"),
    ("titration.water.exit_mean", "water zone, mean", 1.0, ".4f"),
    ("titration.water.exit_min", "water zone, worst row", 1.0, ".4f"),
    ("utilisation.water", "water used", 1.0, ".3f"),
    ("cvd.rate_mean", "CVD, 1e-12 mol/m³/s", 1e12, ".3g"),
)


def cycle(rate: str, temperature: float, mesh: str) -> Numbers:
    """The cycle, steady, with what `mpm check` says of its water zone."""
    changes = {**RATES[rate], "gas.temperature": f"{temperature} K"}
    case = case_of("single_cycle", mesh, STEADY, changes)
    found = run(f"rates-{list(RATES).index(rate)}-{temperature:g}-{mesh}", case)
    water = check_case(case)["inlets"]["water"]
    names = ("dose_ratio", "front_thickness", "Damkoehler_diffusion", "site_lifetime")
    return found | {f"check.{name}": water[name] for name in names}


def table(meshes: tuple[str, ...]) -> str:
    """By rate and temperature."""
    lines = []
    for rate in RATES:
        for temperature in TEMPERATURES:
            found = [cycle(rate, temperature, mesh) for mesh in meshes]
            first = found[0]
            lines.append(
                [
                    rate,
                    f"{temperature:g}",
                    f"{first['check.dose_ratio']:.2f}",
                    f"{first['check.Damkoehler_diffusion']:.3g}",
                    f"{1e3 * first['check.front_thickness']:.2g}",
                    f"{1e3 * first['check.site_lifetime']:.2g}",
                    *(both([scale * n[name] for n in found], digits) for name, _, scale, digits in COLUMNS),
                ]
            )
    head = [
        "rate constant",
        "K",
        "dose ratio",
        "Da of water",
        "reaction front of water, mm",
        "a site waits, ms",
    ]
    return f"{measured_on(meshes)}\n\n" + markdown([*head, *(head for _, head, _, _ in COLUMNS)], lines)
