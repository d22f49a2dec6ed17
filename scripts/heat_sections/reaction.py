"""By how much heat of reaction warms an insulated bed, against dT = -dH S n_s/C_h of all its sites."""

from __future__ import annotations

from typing import Any

from heat_sections.store import STEADY, Numbers, both, case_of, markdown, measured_on, run
from mpm import Case
from mpm.advice.checks import check_case

MANY = {"material.glass_beads.site_density": "one-per-24-square-angstrom"}
DOSES = {
    "single_zone": {"tma": ("TMA", 2e-4)},
    "single_cycle": {"tma": ("TMA", 2e-4), "water": ("H2O", 7.5e-5)},
}
VARIANTS: dict[str, tuple[float, dict[str, Any]]] = {
    "base case": (1.0, {}),
    "one site per 24 Å²": (1.0, MANY),
    "one site per 24 Å², 100 times the dose": (100.0, MANY),
}


def insulated(name: str, variant: str, mesh: str) -> Case:
    """The case without walls, steady: its frit is saturated."""
    times, sites = VARIANTS[variant]
    doses = {
        f"geometry.inlet.{inlet}.mass_fractions.{species}": times * dose
        for inlet, (species, dose) in DOSES[name].items()
    }
    return case_of(name, mesh, STEADY, sites, doses, {"energy": {}})


def rise(name: str, variant: str, mesh: str) -> Numbers:
    """Numbers of the run; `share` of the sites that leave coated; rise of the powder that leaves: `rise`, of `all` sites once, and
    `from heat`: if the bed took all heat of reaction [K]."""
    case = insulated(name, variant, mesh)
    found = run(f"reaction-{name}-{list(VARIANTS).index(variant)}-{mesh}", case)
    per_site = check_case(case)["energy"]["bed"]["adiabatic_rise"]
    whole = sum(per_site[inlet] for inlet in DOSES[name])
    share = min(found[f"titration.{inlet}.exit_mean"] for inlet in DOSES[name])
    layer = case.geometry.layers[2]
    passing = (
        case.motion.bed_velocity * layer.height * check_case(case)["energy"]["layers"]["bed"]["heat_capacity"]
    )
    found |= {"rise": found["temperature.bed_exit"] - 473.0, "all": whole, "share": share}
    return found | {"from heat": found["energy.reaction"] / passing}


def table(meshes: tuple[str, ...]) -> str:
    """By case and number of sites."""
    lines = []
    for name in DOSES:
        for variant in VARIANTS:
            found = [rise(name, variant, mesh) for mesh in meshes]
            first = found[0]
            lines.append(
                [
                    name.replace("_", " "),
                    variant,
                    f"{first['share']:.3f}",
                    f"{1e3 * first['all']:.3g}",
                    both([1e3 * n["from heat"] for n in found], ".3g"),
                    both([1e3 * n["rise"] for n in found], ".3g"),
                    both([1e3 * (n["temperature.bed.max"] - 473.0) for n in found], ".3g"),
                    f"{first['energy.reaction']:.3g}",
                    f"{-100 * first['energy.outlets'] / first['energy.reaction']:.1f}",
                ]
            )
    head = [
        "case",
        "sites",
        "coated at the exit",
        "-ΔH S n_s/C_h of all sites, mK",
        "all heat of reaction in the bed, mK",
        "powder leaves warmer by, mK",
        "hottest of the bed, mK",
    ]
    return f"{measured_on(meshes)}\n\n" + markdown(
        [*head, "heat of reaction, W/m", "of it with the gas, %"], lines
    )
