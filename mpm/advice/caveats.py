"""What is legal in a case but may not be meant: inputs that contradict each other, or have no effect. One sentence each."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from mpm.case.profile import PRESETS
from mpm.motion.schedule import Schedule
from mpm.output.phases import LastCycle
from mpm.physics.diffusion import carrier_ratio, scaled_diffusivity
from mpm.physics.elements import formula_mass, parse_formula
from mpm.physics.gases import CARRIERS, ideal_gas_density

if TYPE_CHECKING:
    from mpm.case.case import Case

SAME_GAMMA = 0.02
"""Relative difference of Gamma that passes between a profile and its use: what an accelerometer resolves."""
SAME_ANGLE = math.radians(1.0)
"""The same for the angle of vibration [rad]."""

SAME_MASS = 0.01
"""Relative difference of a molar mass from that of the formula that is rounding or a mixture of isotopes."""
SAME_SITES = 0.01
"""Relative difference of a site density from that of a mechanism's file that is rounding."""
SAME_DENSITY = 0.05
"""Relative difference of a typed density from the ideal gas' that real gases have."""
SAME_PROPERTY = 2.0
"""Factor by which a typed viscosity or diffusivity may differ from the model's: correlations and measurements differ by less."""


def profile_caveats(case: Case) -> list[str]:
    """Whether the profile file, its vibration and `motion.bed_velocity` belong together.

    Another frequency is refused when the case is read. Another acceleration or angle is common practice (a profile of a DEM scaled to a
    measured mean, used in a sweep over gamma) and keeps the mean, but in contact the bed then no longer rides with the plate.
    """
    motion = case.motion
    name = Path(motion.profile).name
    if motion.gamma == 0.0 and motion.profile not in PRESETS:
        return [
            f"motion.profile: the bed does not move as {name} says but steadily at bed_velocity, for nothing vibrates (gamma = 0)"
        ]
    if motion.table is None:
        return []
    found = []
    if "bed_velocity" in motion.model_fields_set:
        found.append(
            f"motion.bed_velocity: the bed does not move at {motion.bed_velocity * 100:.3g} cm/s but as {name} says, "
            f"{motion.mean_velocity * 100:.3g} cm/s in the mean"
        )
    made = motion.table.conditions
    if made is None:
        return [
            *found,
            f"{name} does not say under which vibration it was made (mpm dem writes a comment `conditions`): "
            "nothing can tell whether it belongs to this one",
        ]
    slides = "in contact its bed does not ride with this plate, only the mean is kept"
    if made.waveform != "sine":
        found.append(
            f"{name} was made with a {made.waveform} waveform, the reactor vibrates in a sine: {slides}"
        )
        return found
    if abs(made.gamma - motion.gamma) > SAME_GAMMA * motion.gamma:
        found.append(
            f"{name} was made at gamma {made.gamma:.3g}, the reactor vibrates at {motion.gamma:.3g}: {slides}"
        )
    angle = motion.angle if motion.angle_from == "horizontal" else 0.5 * math.pi - motion.angle
    if abs(made.angle - angle) > SAME_ANGLE:
        found.append(
            f"{name} was made at {math.degrees(made.angle):.3g} deg from the horizontal, the reactor vibrates at "
            f"{math.degrees(angle):.3g} deg: {slides}"
        )
    return found


def gas_caveats(case: Case) -> list[str]:
    """Typed properties of the gas that its temperature, pressure and carrier contradict, and diffusivities in a gas that is not known."""
    gas, found = case.gas, []
    state = f"{gas.carrier} at {gas.temperature:g} K and {gas.pressure:.6g} Pa"
    ideal = ideal_gas_density(pressure=gas.pressure, molar_mass=gas.molar_mass, temperature=gas.temperature)
    if abs(gas.density - ideal) > SAME_DENSITY * ideal:
        found.append(
            f"gas.density is {gas.density:.4g} kg/m3, {state} has {ideal:.4g} kg/m3: feeds are counted with the latter"
        )
    model = CARRIERS.get(gas.carrier)
    if model is not None and _apart(gas.viscosity, model.viscosity(gas.temperature)):
        found.append(
            f"gas.viscosity is {gas.viscosity:.3g} Pa s, {state} has about {model.viscosity(gas.temperature):.3g} Pa s"
        )
    if model is not None and case.energy is not None:
        for key, value, usual, unit in (
            ("heat_capacity", gas.heat_capacity, model.heat_capacity(gas.temperature), "J/kg/K"),
            ("conductivity", gas.conductivity, model.conductivity(gas.temperature), "W/m/K"),
        ):
            if _apart(value, usual):
                found.append(f"gas.{key} is {value:.3g} {unit}, {state} has about {usual:.3g} {unit}")
    told: dict[str, list[str]] = {}  # species of whom the same is to be said
    for species in case.mechanism.species:
        value = gas.diffusivity[species.name]
        scaled = scaled_diffusivity(
            species,
            gas.carrier,
            molar_mass=gas.molar_mass,
            temperature=gas.temperature,
            pressure=gas.pressure,
        )
        if species.name not in gas.scaled and value > 0.0 and _apart(value, scaled):
            text = (
                f"is {value:.3g} m2/s, in {state} it would be about {scaled:.3g} m2/s: left out, it is scaled"
            )
        elif species.name in gas.scaled and carrier_ratio(species, gas.carrier, gas.molar_mass) is None:
            text = f"is that in N2, {scaled:.3g} m2/s: nothing is known of it in {gas.carrier}, give a value"
        else:
            continue
        told.setdefault(text, []).append(species.name)
    return found + [f"gas.diffusivity of {', '.join(names)} {text}" for text, names in told.items()]


def feed_caveats(case: Case) -> list[str]:
    """Inlets whose engineering numbers are of one of several precursors."""
    found = []
    for inlet in case.geometry.inlets:
        fed = case.precursors(inlet)
        if len(fed) > 1:
            found.append(
                f"inlet {inlet.name} feeds several precursors, {', '.join(fed)}: its excess number, titration, utilisation and front are "
                f"those of {fed[0]}"
            )
    return found


def site_density_caveats(case: Case) -> list[str]:
    """Materials with other sites per area than the file of Cantera has, whose constants per site were written for these."""
    theirs = case.mechanism_site_density
    if theirs is None:
        return []
    used = {layer.material_name: layer.material for layer in case.geometry.layers}
    apart = [
        name
        for name, material in used.items()
        if name is not None
        and material is not None
        and material.site_density > 0.0
        and abs(material.site_density - theirs) > SAME_SITES * theirs
    ]
    if not apart:
        return []
    mine = ", ".join(f"{case.materials[name].site_density:.4g} mol/m2 of {name}" for name in apart)
    return [
        f"{case.mechanism.name} was written for {theirs:.5g} mol/m2 of sites, here its constants per site meet {mine}: "
        f'material.{apart[0]}.site_density = "{theirs:.5g} mol/m^2" is that of the file'
    ]


def polynomial_caveats(case: Case) -> list[str]:
    """Polynomials of enthalpy and entropy that the case reads beyond the temperatures that they were fitted to."""
    chemistry, found = case.chemistry, dict[tuple[float, float], list[str]]()
    coldest, hottest = case.temperatures[0], case.temperatures[-1]
    for table in (chemistry.species, chemistry.site, chemistry.film):
        for name, substance in table.items():
            read = case.energy is not None or name in case.mechanism.equilibrated
            if substance.nasa is None or not read:
                continue
            lowest, _, highest = substance.nasa.temperatures
            if coldest < lowest or hottest > highest:
                found.setdefault((lowest, highest), []).append(name)
    at = f"{coldest:g} K" if coldest == hottest else f"{coldest:g} to {hottest:g} K"
    return [
        f"nasa polynomials of {', '.join(names)} are those of {lowest:g} to {highest:g} K and are continued to {at}"
        for (lowest, highest), names in found.items()
    ]


def steady_caveats(case: Case) -> list[str]:
    """Inlets that dose for a time only: the steady state is that after the last window, without them."""
    if case.fidelity != "steady":
        return []
    return [
        f"inlet {inlet.name} stops dosing at {inlet.windows[-1][1]:g} s: in the steady state it blows carrier gas alone"
        for inlet in case.geometry.inlets
        if inlet.feed and not inlet.stays_open
    ]


def output_caveats(case: Case) -> list[str]:
    """Output times of a resolved run that always meet the same phase of the vibration, and a run too short for a whole cycle."""
    if case.fidelity != "resolved" or case.motion.gamma == 0.0:
        return []
    period, schedule = 1.0 / case.motion.frequency, Schedule.from_case(case)
    cycle = f"{period * 1e3:.4g} ms"
    if case.output.phases:
        if not LastCycle.of(case, schedule).empty:
            return []
        return [
            f"output.phases: the run ends at {case.time.end:g} s, before the first whole cycle of {cycle} since the vibration starts at "
            f"{case.motion.start:g} s: no phases are written"
        ]
    every, steps = case.output.every, case.time.steps_per_cycle
    drift = abs(every - round(every / period) * period) * case.time.end / every  # over the run
    if every < 0.5 * period or drift > schedule.dt:
        return []
    fitting = 16 if steps % 16 == 0 else steps
    return [
        f"outputs every {every:g} s always meet the same phase of the vibration (cycles of {cycle}): output.phases = {fitting} "
        "writes the last cycle phase by phase"
    ]


def _apart(value: float, expected: float) -> bool:
    return not expected / SAME_PROPERTY <= value <= expected * SAME_PROPERTY


def mass_caveats(case: Case) -> list[str]:
    """Molar masses that contradict the formula, of gas species, sites, films and the carrier."""
    found = []
    mechanism = case.mechanism
    for kind, parts in (
        ("species", mechanism.species),
        ("site", mechanism.sites),
        ("film", mechanism.films),
    ):
        for part in parts:
            formula = formula_mass(part.elements)
            if part.molar_mass is not None and formula is not None:
                found += _wrong_mass(f"chemistry.{kind}.{part.name}.molar_mass", part.molar_mass, formula)
    try:
        carrier = formula_mass(parse_formula(case.gas.carrier))
    except ValueError:  # a name that is no formula
        carrier = None
    return found if carrier is None else found + _wrong_mass("gas.molar_mass", case.gas.molar_mass, carrier)


def _wrong_mass(key: str, found: float, expected: float) -> list[str]:
    if abs(found - expected) <= SAME_MASS * expected:
        return []
    return [
        f"{key} is {found * 1e3:.6g} g/mol, its formula has {expected * 1e3:.5g} g/mol: {found / expected:.4g} times as much"
    ]
