"""The flow of a run as the reactor uses it, and as it may be handed from one run to the next."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats, Ints
from mpm.errors import InputError
from mpm.flow.sequence import CyclicFlow, FlowSequence, MarchedFlow, Watch, begins_at_rest
from mpm.parallel import any_rank
from mpm.transport.dispersion import vibrational_dispersion

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.mesh.strip import Strip
    from mpm.motion.kinematics import BedMotion
    from mpm.motion.schedule import Schedule


@dataclass(frozen=True, eq=False)
class Flow:
    """The velocity fields of a run in the local `cells` of the grid, and the `dispersion` (diffusivities, 2, local cells) [m2/s] that
    vibration adds, None without; `conditions` are those that the fields depend on, `dispersed_in` those of the dispersion beyond them."""

    sequence: FlowSequence
    cells: Ints
    conditions: dict[str, Any]
    dispersion: Floats | None = None
    dispersed_in: dict[str, Any] | None = None


def find_flow(
    case: Case, strip: Strip, bed_motion: BedMotion, schedule: Schedule, watch: Watch | None = None
) -> Flow:
    """The flow of a case, without dispersion; collective. `watch` is called as it is found. Raises ConvergenceError."""
    sequence: FlowSequence
    if _is_marched(case):
        sequence = MarchedFlow(case, strip, bed_motion, schedule)
    else:
        sequence = CyclicFlow.solve(case, strip, bed_motion, schedule, watch)
    return Flow(sequence, strip.cell, conditions(case, schedule))


def dispersed(
    flow: Flow,
    case: Case,
    strip: Strip,
    bed_motion: BedMotion,
    diffusivities: list[float],
    watch: Watch | None = None,
) -> Flow:
    """`flow` with the dispersion of gases with these `diffusivities` [m2/s] where the case asks for it; collective.

    Raises ConvergenceError.
    """
    wanted = dispersion_conditions(case, diffusivities)
    if wanted == flow.dispersed_in:
        return flow
    found = None if wanted is None else vibrational_dispersion(case, strip, bed_motion, diffusivities, watch)
    return replace(flow, dispersion=found, dispersed_in=wanted)


def taken_over(flow: Flow, case: Case, strip: Strip, schedule: Schedule) -> Flow:
    """`flow`, found for another case; species and doses may differ. Raises InputError where it would be another one for `case`.

    Collective.
    """
    if case.energy is not None:
        raise InputError(
            "flow: found that of another run for a case with [energy], whose flow follows its own temperatures; accepted: none"
        )
    if not isinstance(flow.sequence, CyclicFlow):
        raise InputError(
            "flow: found a transient, which belongs to one run; accepted: the flow of a developed run without heat"
        )
    for name, wanted in conditions(case, schedule).items():
        if flow.conditions[name] != wanted:
            raise InputError(
                f"flow: found that of another {name}; accepted: that of a case which differs in species and doses only"
            )
    if any_rank(strip.comm, not np.array_equal(flow.cells, strip.cell)):
        raise InputError("flow: found that of other ranks; accepted: that of a reactor on as many ranks")
    return flow


def conditions(case: Case, schedule: Schedule) -> dict[str, Any]:
    """All of a case that its flow depends on, by names for people."""
    geometry = case.geometry
    return {
        "mesh": (geometry.length, geometry.columns, geometry.periodic),
        "layer": [(layer.height, layer.cells, layer.grading, layer.moving) for layer in geometry.layers],
        "material": [
            (solid.porosity, solid.slip_permeability(case.gas.mean_free_path), solid.viscosity_ratio)
            if (solid := layer.material)
            else None
            for layer in geometry.layers
        ],
        "inlet": [(port.side, port.x0, port.x1, port.velocity) for port in geometry.inlets],
        "outlet": [(port.side, port.x0, port.x1) for port in geometry.outlets],
        "gas": (case.gas.density, case.gas.viscosity),
        "motion": case.motion,
        "inertia": case.porous.inertia,
        "fidelity": (schedule.phases, begins_at_rest(case, schedule), _is_marched(case)),
    }


def dispersion_conditions(case: Case, diffusivities: list[float]) -> dict[str, Any] | None:
    """What the dispersion of gases with these `diffusivities` [m2/s] depends on beside the flow; None where the case has none."""
    if not diffusivities or not case.transport.vibrational_dispersion or _is_marched(case):
        return None
    return {
        "diffusivities": list(diffusivities),
        "steps per cycle": case.time.steps_per_cycle,
        "tortuosity": [layer.material and layer.material.tortuosity_factor for layer in case.geometry.layers],
        "inlet diffusion": case.geometry.inlet_diffusion,
        "scheme": case.transport.scheme,
        "diffusion in pores": case.porous.diffusion,
    }


def _is_marched(case: Case) -> bool:
    return case.fidelity == "resolved" and case.motion.startup == "impulsive"
