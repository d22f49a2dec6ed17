"""Keys that somebody typed and that nothing reads in this case. They stay legal: another fidelity may use them.

A key whose value is the one that it has when it is left out is not named: it says nothing. So the resolved case that a run writes, which
gives every key, names only those that its own case did.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from mpm.advice.conventions import idle_switches
from mpm.case.chemistry import HEATS
from mpm.case.materials import BUILT_IN, Material
from mpm.case.motion import FORCES

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.chemistry import SolidTable, SpeciesTable
    from mpm.case.motion import Motion

_CYCLE = ("frequency", "angle", "angle_from", "liftoff_velocity", "liftoff_phase", "contact_phase")
"""Keys of [motion] that shape the cycle, not its mean."""
_TABLES = ("species", "site", "film", "reaction")
_ISOTHERMAL = "temperature is one number, gas.temperature"


def idle_keys(case: Case) -> list[str]:
    """Sentences `key, key: why they have no effect`, one for each reason."""
    return [f"{', '.join(keys)}: {why}" for why, keys in reasons(case).items()]


def reason(case: Case, key: str) -> str | None:
    """Why what a case has under `key`, or under a table that holds it, has no effect; None where it has, or is the default."""
    keys = [key, *(key[:i] for i, c in enumerate(key) if c == ".")]
    return next((why for why, idle in reasons(case).items() if any(one in idle for one in keys)), None)


def reasons(case: Case) -> dict[str, list[str]]:
    """The keys without effect, by the reason."""
    found: dict[str, dict[str, None]] = {}
    for key, why in (
        *_of_motion(case),
        *_of_time(case),
        *_of_ports(case),
        *idle_switches(case),
        *_of_energy(case),
        *_of_solids(case),
        *_of_entropies(case),
        *_of_mechanism(case),
    ):
        found.setdefault(why, {})[key] = None
    return {why: list(keys) for why, keys in found.items()}


Idle = Iterator[tuple[str, str]]


def _typed(model: Any, table: str, keys: Iterable[str], why: str) -> Idle:
    return ((f"{table}.{key}", why) for key in keys if key in model.model_fields_set and _says(model, key))


def _says(model: Any, key: str) -> bool:
    """Whether the key's value is another than its default."""
    value, default = getattr(model, key), type(model).model_fields[key].get_default()
    if isinstance(value, float) and isinstance(default, float):
        return not math.isclose(value, default, rel_tol=1e-12)
    return bool(value != default)


def _of_motion(case: Case) -> Idle:
    motion, dispersed = case.motion, case.transport.vibrational_dispersion
    if motion.gamma == 0.0:
        still = (*_CYCLE, *(FORCES if motion.balances else ()))  # others name them in _of_forces
        cycle = still[1:] if case.fidelity == "resolved" else still  # whose steps are parts of a cycle
        yield from _typed(motion, "motion", cycle, "nothing vibrates (gamma = 0)")
        yield from _typed(
            case.transport,
            "transport",
            ["vibrational_dispersion"] if dispersed else [],
            "nothing vibrates (gamma = 0)",
        )
        phases = ["phases"] if case.output.phases else []
        yield from _typed(case.output, "output", phases, "nothing vibrates (gamma = 0)")
    elif motion.balances:
        yield from _typed(motion, "motion", ["liftoff_velocity"], "motion.profile is not thesis")
    elif not case.follows_cycle:
        cycle = (*_CYCLE, "inlet_frame", *(() if motion.table is not None else ("gamma", "profile")))
        why = f"a run with fidelity {case.fidelity} sees the bed's mean velocity, not the cycle (vibrational_dispersion would)"
        yield from _typed(motion, "motion", cycle, why)
    elif motion.profile != "thesis":
        yield from _typed(motion, "motion", ["liftoff_velocity"], "motion.profile is not thesis")
    if motion.gamma > 0.0 and motion.profile != "phases":
        yield from _typed(
            motion, "motion", ["liftoff_phase", "contact_phase"], "motion.profile is not phases"
        )
    if case.fidelity != "resolved":
        yield from _typed(motion, "motion", ["startup"], "only fidelity resolved follows the start")
    if case.geometry.moving_layer is None:
        yield from _typed(motion, "motion", ["bed_velocity"], "no layer moves")
        yield from _typed(case.geometry, "geometry", ["bed_inflow"], "no layer moves")
    yield from _of_forces(motion)


def _of_forces(motion: Motion) -> Idle:
    """Keys of the forces on a bed that moves otherwise, and those that forces leave nothing to say."""
    if not motion.balances:
        yield from _typed(motion, "motion", FORCES, "motion.profile is not force_balance")
        return
    yield from _typed(
        motion, "motion", ["bed_velocity"], "forces decide how fast the bed moves (motion.profile)"
    )
    if motion.through_velocity is not None and motion.gamma > 0.0:
        yield from _typed(
            motion, "motion", ["through_flow"], "motion.through_velocity says how much gas rises"
        )


def _of_time(case: Case) -> Idle:
    if case.fidelity == "steady":
        why = "a steady state has no time"
        yield from _typed(case.motion, "motion", ["start"], why)
        yield from _typed(case.time, "time", ["end", "step"], why)
        yield from _typed(case.output, "output", ["every", "checkpoint"], why)
    elif case.fidelity == "resolved":
        yield from _typed(case.time, "time", ["step"], "a resolved run has steps_per_cycle")
    if not case.follows_cycle:
        yield from _typed(
            case.time, "time", ["steps_per_cycle"], "only a run that follows the cycle has them"
        )


def _of_ports(case: Case) -> Idle:
    for inlet in case.geometry.inlets:
        keys = ("start", "stop", "windows")
        if not inlet.doses:
            why = "an inlet without mass_fractions blows carrier gas all the time"
            yield from _typed(inlet, f"geometry.inlet.{inlet.name}", keys, why)
        elif case.fidelity == "steady" and inlet.windows[0][0] > 0.0:
            why = "of dose windows a steady state takes only whether the last one stays open"
            yield from _typed(inlet, f"geometry.inlet.{inlet.name}", keys, why)
    for layer in case.geometry.layers:
        if layer.cells == 1:
            yield from _typed(layer, f"geometry.layer.{layer.name}", ["grading"], "the layer has one row")


def _of_energy(case: Case) -> Idle:
    """Keys of temperature in a case that has one, or not."""
    if case.energy is None:
        yield from (
            (f"gas.{key}", _ISOTHERMAL)
            for key in ("heat_capacity", "conductivity")
            if key in case.typed("gas")
        )
        for table in _TABLES:
            for name in case.typed(f"chemistry.{table}"):
                typed = case.typed(f"chemistry.{table}.{name}")
                keys = (*HEATS, *(("viscosity",) if table == "species" else ()))
                if table != "reaction" and name in case.mechanism.equilibrated:
                    keys = ("viscosity",)
                yield from ((f"chemistry.{table}.{name}.{key}", _ISOTHERMAL) for key in keys if key in typed)
        return
    if not case.gas.mixture:
        for name in case.typed("chemistry.species"):
            if "viscosity" in case.typed(f"chemistry.species.{name}"):
                yield f"chemistry.species.{name}.viscosity", "the gas is no mixture (gas.mixture)"
    if case.fidelity == "steady":
        yield from _typed(
            case.energy, "energy", ["flow_update"], "a steady flow is that of its own temperatures"
        )
        if case.energy.initial_temperature != case.gas.temperature:
            yield "energy.initial_temperature", "a steady state has no time"
    geometry = case.geometry
    if case.bed_temperature != case.gas.temperature and (
        case.conveying_velocity == 0.0 or geometry.bed_inflow == "periodic"
    ):
        yield "geometry.bed_temperature", "no fresh solids come in"
    for inlet in geometry.inlets:
        if inlet.velocity == 0.0 and case.inlet_temperature(inlet) != case.gas.temperature:
            yield f"geometry.inlet.{inlet.name}.temperature", "the inlet is closed (velocity 0)"


def _of_solids(case: Case) -> Idle:
    used = {layer.material_name for layer in case.geometry.layers}
    for name in case.typed("material"):
        if name not in used:
            yield f"material.{name}", "no layer is made of it"
            continue
        given = case.typed(f"material.{name}")
        material = case.materials[name]
        usual = Material.model_validate(BUILT_IN[name]) if name in BUILT_IN else None
        for key in ("heat_capacity", "conductivity", "effective_conductivity"):
            differs = usual is None or getattr(usual, key) != getattr(material, key)
            if key in given and differs and case.energy is None:
                yield f"material.{name}.{key}", _ISOTHERMAL
            elif (
                key == "conductivity"
                and key in given
                and differs
                and material.effective_conductivity is not None
            ):
                yield f"material.{name}.{key}", "the layer has an effective_conductivity"
        if "kozeny_constant" in given and material.particle_diameter is None:
            yield f"material.{name}.kozeny_constant", "it needs a particle_diameter"


def _of_entropies(case: Case) -> Idle:
    """Entropies are read where a way back follows from them; with temperature as one number so are enthalpies (`_of_energy`)."""
    why = "no way back of a reaction follows from enthalpies and entropies"
    if case.energy is not None:
        for table in _TABLES[:3]:
            for name in case.typed(f"chemistry.{table}"):
                if (
                    "entropy" in case.typed(f"chemistry.{table}.{name}")
                    and name not in case.mechanism.equilibrated
                ):
                    yield f"chemistry.{table}.{name}.entropy", why
    if not case.mechanism.equilibrated and "reference_pressure" in case.typed("chemistry"):
        yield from _typed(case.chemistry, "chemistry", ["reference_pressure"], why)


def _of_mechanism(case: Case) -> Idle:
    for name, table in case.chemistry.reaction.items():
        for key, constant in (
            ("", table),
            (".reverse", table.reverse),
            (".equilibrium_constant", table.equilibrium_constant),
        ):
            if constant is not None and constant.reference_temperature != 1.0 and constant.b == 0.0:
                yield f"chemistry.reaction.{name}{key}.reference_temperature", "b is 0"
    tables: dict[str, Mapping[str, SpeciesTable | SolidTable]] = {
        "species": case.chemistry.species,
        "site": case.chemistry.site,
        "film": case.chemistry.film,
    }
    for kind, entries in tables.items():
        for name, entry in entries.items():
            if entry.formula is not None and entry.elements is not None:
                yield f"chemistry.{kind}.{name}.formula", "elements are counted by hand"
    for name, film in case.chemistry.film.items():
        if film.density is not None and film.molar_mass is None:
            yield f"chemistry.film.{name}.density", "a thickness needs its molar_mass too"
