"""Whether the headspace turns over, and what that does to the precursor."""

from __future__ import annotations

from typing import Any

from heat_sections.store import (
    COARSE,
    HOT,
    SATURATED,
    STEADY,
    Numbers,
    both,
    case_of,
    fastest,
    in_time,
    markdown,
    measured_on,
    run,
)
from mpm.physics.gases import ideal_gas_density
from mpm.physics.thermal import rayleigh

ROOF = 373.15  # K
BEDS: dict[str, dict[str, Any]] = {
    "powder enters at 298 K, roof at 473 K": {},
    "powder enters at 473 K, roof at 373 K": {
        "geometry.bed_temperature": f"{HOT} K",
        "geometry.wall.roof_left.temperature": f"{ROOF} K",
        "geometry.wall.roof_right.temperature": f"{ROOF} K",
    },
}
STABLE, UNSTABLE = BEDS
SECONDS = 30.0
WAYS: dict[str, dict[str, Any]] = {
    "steady": STEADY,
    "averaged": {"fidelity": "averaged"},
    "marched": {
        "fidelity": "resolved",
        "motion.startup": "impulsive",
        "motion.gamma": 0.0,
        "motion.frequency": "6 Hz",
        "motion.start": "0 s",
    },
}
"""`marched`: in steps of 5 ms with the gas's own inertia and without vibration; `averaged` finds the flow of each temperature anew."""


def zone(setting: str, buoyancy: bool, way: str, mesh: str) -> Numbers:
    """The zone with a saturated frit."""
    end = SECONDS if mesh != COARSE else 0.6
    changes: dict[str, Any] = {"energy.buoyancy": buoyancy, "time.end": f"{end} s"}
    if way != "steady":
        changes["output.every"] = f"{end / 60} s"
    label = f"headspace-{list(BEDS).index(setting)}-{'with' if buoyancy else 'without'}-{way}-{mesh}"
    return run(label, case_of("heating", mesh, BEDS[setting], SATURATED, WAYS[way], changes), fastest)


def cycle(buoyancy: bool, mesh: str) -> Numbers:
    """The cycle of TMA and water under a roof at 373 K, all else at 473 K: does the headspace mix the precursors?"""
    changes: dict[str, Any] = {"geometry.bed_temperature": f"{HOT} K", "energy.buoyancy": buoyancy}
    changes |= {f"geometry.wall.roof{i}.temperature": f"{ROOF} K" for i in (1, 2, 3)}
    changes |= {f"geometry.inlet.purge{i}.temperature": f"{HOT} K" for i in (1, 2)}
    end = 20.0 if mesh != COARSE else 0.6
    changes |= {"time.end": f"{end} s", "output.every": f"{end / 60} s"}
    label = f"cycle-{'with' if buoyancy else 'without'}-{mesh}"
    return run(label, case_of("hot_cycle", mesh, SATURATED, WAYS["marched"], changes), fastest)


def rayleigh_number(layer: str, cold: float, hot: float) -> float:
    """Ra of a layer of the strip between two temperatures [K], properties at their mean; critical: 1708."""
    case = case_of("heating", "full")
    gas, mean = case.gas, 0.5 * (cold + hot)
    density = ideal_gas_density(pressure=gas.pressure, molar_mass=gas.molar_mass, temperature=mean)
    return rayleigh(
        difference=hot - cold,
        height=next(found.height for found in case.geometry.layers if found.name == layer),
        temperature=mean,
        viscosity=gas.viscosity_at(mean),
        density=density,
        diffusivity=gas.conductivity_at(mean) / (density * gas.heat_capacity),
    )


def numbers_of_rayleigh() -> str:
    """Ra of headspace and plenum in both settings, and which of the sides is warm."""
    lines = [
        [STABLE, "headspace", "above", f"{rayleigh_number('headspace', 298.15, HOT):.0f}", "never"],
        [STABLE, "plenum", "below", f"{rayleigh_number('plenum', 298.15, HOT):.0f}", "1708"],
        [UNSTABLE, "headspace", "below", f"{rayleigh_number('headspace', ROOF, HOT):.0f}", "1708"],
    ]
    return markdown(["setting", "gas in", "warm", "Ra", "turns over from"], lines)


ZONE = (
    ("rising.headspace", "fastest up or down, cm/s", 1e2, ".1f"),
    ("late.energy.walls", "heat from walls, W/m", 1.0, ".1f"),
    ("temperature.bed_exit", "powder leaves at, K", 1.0, ".2f"),
    ("titration.tma.box_mean", "coated before the TMA port", 1.0, ".3f"),
    ("titration.tma.exit_min", "coated at the exit, worst row", 1.0, ".4f"),
    ("utilisation.tma", "TMA used", 1.0, ".3f"),
    ("late.outlets.zone1.x.TMA", "TMA in the outlet, 1e-6", 1e6, ".1f"),
    ("late.outlets.zone1.backflow", "drawn back in", 1.0, ".2f"),
)
CYCLE = (
    ("rising.headspace", "fastest up or down, cm/s", 1e2, ".1f"),
    ("titration.tma.exit_mean", "coated, TMA", 1.0, ".4f"),
    ("titration.water.exit_mean", "coated, water", 1.0, ".4f"),
    ("contamination.zone2.TMA", "TMA that came over into zone 2", 1.0, ".3f"),
    ("contamination.zone1.H2O", "water that came over into zone 1", 1.0, ".3f"),
    ("late.cvd.rate_mean", "CVD, 1e-12 mol/m³/s", 1e12, ".3g"),
)


def zone_table(meshes: tuple[str, ...]) -> str:
    """Both settings with and without buoyancy."""
    lines = []
    for setting, way in ((STABLE, "steady"), (UNSTABLE, "averaged"), (UNSTABLE, "marched")):
        on = {"steady": meshes, "averaged": in_time(meshes), "marched": in_time(meshes)[-1:]}[way]
        for buoyancy in (True, False):
            found = [zone(setting, buoyancy, way, mesh) for mesh in on]
            lines.append([setting, "yes" if buoyancy else "no", way, *(cells(found, ZONE))])
    return markdown(["setting", "buoyancy", "how", *(head for _, head, _, _ in ZONE)], lines)


def cells(found: list[Numbers], columns: tuple[tuple[str, str, float, str], ...]) -> list[str]:
    """A row of numbers; those of a steady state have no mean in time, and what there is none of is left open."""
    row = []
    for name, _, scale, digits in columns:
        values = [n.get(name, n.get(name.removeprefix("late."))) for n in found]
        known = [scale * value for value in values if value is not None]
        row.append(both(known, digits) if known else "")
    return row


def table(meshes: tuple[str, ...]) -> str:
    """Numbers of Rayleigh, the zone, and the cycle under a cold roof."""
    last = in_time(meshes)[-1:]
    lines = [
        ["yes" if buoyancy else "no", *cells([cycle(buoyancy, mesh) for mesh in last], CYCLE)]
        for buoyancy in (True, False)
    ]
    zones = zone_table(meshes)
    below = markdown(["cycle under a roof at 373 K, buoyancy", *(head for _, head, _, _ in CYCLE)], lines)
    where = f"Steady: {measured_on(meshes)} In time: {measured_on(in_time(meshes))} Marched, and the cycle: {measured_on(last)}"
    return f"{numbers_of_rayleigh()}\n\n{where}\n\n{zones}\n\n{below}"
