"""The coupled parts of a reactor and one step of them: mesh, motion, flow, coverage, species. No files, no clock, no log."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mpm.arrays import Floats
from mpm.errors import ConvergenceError
from mpm.flow.sequence import CyclicFlow, MarchedFlow, Watch, begins_at_rest
from mpm.flow.state import GasState
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion, step_motion
from mpm.motion.schedule import RESTING, Schedule, Step
from mpm.numerics import fem
from mpm.numerics.memory import give_back
from mpm.parallel import on_root, total
from mpm.reactor.flow import Flow, conditions, dispersed, dispersion_conditions, find_flow, taken_over
from mpm.reactor.thermal import Thermal, ThermalMemento
from mpm.transport.coverage import Coverage, Memento
from mpm.transport.species import Operators, Transport, TransportMemento

from mpi4py import MPI  # isort: skip  (after fem)

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.flow.fields import FlowField


class System:
    """One case on the ranks of `comm`; all methods that look at it or change it are collective.

    `thermal` is there with `[energy]`. `sites_initially` (site species,) and `stored_initially` (species,) [mol/m] are what balances count
    from.
    """

    def __init__(self, case: Case, comm: MPI.Comm):
        self.case, self.comm = case, comm
        on_root(comm, fem.check_cache)
        self.schedule = Schedule.from_case(case)
        self.strip = Strip(case, comm)
        self.grid = self.strip.grid
        self.bed_motion = BedMotion(case.motion)
        self.coverage = Coverage(case, self.strip)
        self.transport = Transport(case, self.strip, self.coverage)
        self.thermal: Thermal | None = None
        if case.energy is not None:
            self.thermal = Thermal(case, self.strip, self.bed_motion, self.schedule, self.transport)
        self._flow: Flow | None = None
        self._operators: dict[FlowField, Operators] = {}
        self.count_from_here()

    @property
    def gas(self) -> GasState | None:
        """The state of the gas; None where that of the case is everywhere the same."""
        return None if self.thermal is None else self.thermal.gas

    def count_from_here(self) -> None:
        """Let balances count from the present contents."""
        self.sites_initially = total(self.comm, self.coverage.content())
        self.stored_initially = self.stored_gas()
        if self.thermal is not None:
            self.thermal.count_from_here()

    def stored_gas(self) -> Floats:
        """What the gas holds of each species, (species,) [mol/m]."""
        return total(self.comm, self.transport.concentration @ self.transport.reactions.gas_volume)

    # --- flow ---

    @property
    def flow(self) -> Flow:
        """The flow of the run; found when it is first asked for. Raises ConvergenceError."""
        if self._flow is None:
            return self.find_flow()
        return self._flow

    @property
    def has_flow(self) -> bool:
        """Whether the flow is there, with all that the case asks for."""
        return self._flow is not None

    def find_flow(self, watch: Watch | None = None, known: Flow | None = None) -> Flow:
        """Find the flow, unless that of another reactor is `known`, and the dispersion that the case asks for.

        `watch(cycle, change)` is called meanwhile. Raises ConvergenceError, and InputError for a flow that is not this case's.
        """
        case, strip, motion = self.case, self.strip, self.bed_motion
        if self.thermal is not None and known is None:
            self.thermal.find_flow(watch)
            known = Flow(self.thermal.flow, strip.cell, conditions(case, self.schedule))
        elif known is None:
            known = find_flow(case, strip, motion, self.schedule, watch)
        else:
            known = taken_over(known, case, strip, self.schedule)
        flow = dispersed(known, case, strip, motion, self.transport.diffusivities, watch)
        self._use(flow)
        give_back(self.comm)
        return flow

    def _use(self, flow: Flow, steps: int = 0) -> None:
        self._flow = flow
        if flow.dispersion is not None:
            self.transport.disperse(flow.dispersion)
        self._velocity = flow.sequence.shown(self.schedule.step(max(steps - 1, 0)))

    @property
    def velocity(self) -> FlowField:
        """The velocity field of the step last taken; before the first one that with which it begins."""
        _ = self.flow
        return self._velocity

    def operators(self, velocity: FlowField, at_rest: bool = False) -> Operators:
        """The species' operators in a velocity field; those of a cycle that repeats are kept."""
        if velocity not in self._operators:
            if not self.recurring:
                self._operators.clear()  # no field comes again
            self._operators[velocity] = self.transport.operators(velocity, at_rest)
        return self._operators[velocity]

    @property
    def recurring(self) -> bool:
        """Whether the fields of the flow come again: those of a cycle, while no temperature changes them."""
        if isinstance(self.flow.sequence, MarchedFlow):
            return False
        return self.thermal is None or not self.thermal.flow.changed

    # --- one step ---

    def advance(self, step: Step) -> None:
        """One step: the gas moves, the bed slides, then species and coverage follow over the new position, and heat where there is any.

        Raises ConvergenceError; everything but the flow is then as before.
        """
        before, warm = self._memento(), self.thermal
        try:
            columns = self.coverage.slide(self._slide(step))
            velocity = self.flow.sequence.at(step) if warm is None else warm.begin(step, columns)
            operators = self.operators(velocity, step.phase == RESTING)
            self.transport.advance(operators, step.t0, step.dt)
            if warm is not None:
                warm.finish(velocity, step.dt)
        except ConvergenceError as error:
            self._recall(before)
            raise ConvergenceError(f"step {step.index + 1}: {error}") from error
        self._velocity = velocity

    def _memento(self) -> tuple[Memento, TransportMemento, ThermalMemento | None]:
        thermal = None if self.thermal is None else self.thermal.memento()
        return self.coverage.memento(), self.transport.memento(), thermal

    def _recall(self, memento: tuple[Memento, TransportMemento, ThermalMemento | None]) -> None:
        coverage, transport, thermal = memento
        self.coverage.recall(coverage)
        self.transport.recall(transport)
        if self.thermal is not None and thermal is not None:
            self.thermal.recall(thermal)

    def _slide(self, step: Step) -> float:
        """How far the bed slides over the mesh during `step` [m]: with the mean velocity where the flow is a mean, too.

        Steps that sample the vibration only now and then would shake some columns back into a cell and hurry others past it.
        """
        if step.since < 0.0:
            return 0.0
        if self.schedule.phases == 1:
            return self.bed_motion.mean * step.dt
        return step_motion(self.bed_motion, step.since, step.since + step.dt).slide

    # --- restart ---

    def stored(self) -> dict[str, Any]:
        """Arrays of a restart state, `part.name`, in grid order on rank 0 (None elsewhere for gathered ones)."""
        transport, scatter, sequence = self.transport, self.strip.scatter, self.flow.sequence
        dispersion = self.flow.dispersion
        parts: dict[str, dict[str, Any]] = {
            "species": transport.stored(scatter),
            "ledger": transport.ledger.stored(self.comm, scatter, self.coverage.scatter),
            "coverage": self.coverage.stored(),
            "initially": {"sites": self.sites_initially, "stored": self.stored_initially},
            "flow": {},
        }
        if self.thermal is not None:
            parts |= self.thermal.stored()
        elif isinstance(sequence, MarchedFlow | CyclicFlow):
            parts["flow"]["fields"] = sequence.stored(scatter, self.strip.owned)
        if isinstance(sequence, MarchedFlow):
            parts["flow"]["done"] = sequence.done
        if dispersion is not None:
            parts["flow"]["dispersion"] = scatter.to_root(dispersion[:, :, : self.strip.owned])
        return {f"{part}.{name}": value for part, values in parts.items() for name, value in values.items()}

    def restore(self, stored: dict[str, Any], steps: int) -> None:
        """The inverse of `stored`, on every rank of a system freshly built for the same case that has taken `steps`."""
        parts: dict[str, dict[str, Any]] = {}
        for name, value in stored.items():
            part, _, inside = name.partition(".")
            parts.setdefault(part, {})[inside] = value
        transport, strip = self.transport, self.strip
        transport.restore(strip.scatter, parts["species"])
        transport.ledger.restore(self.comm, strip.scatter, self.coverage.scatter, parts["ledger"])
        self.coverage.restore(parts["coverage"])
        self.sites_initially, self.stored_initially = (
            parts["initially"]["sites"],
            parts["initially"]["stored"],
        )
        if self.thermal is not None:
            self.thermal.restore(parts, steps)
        self._use(self._restored_flow(parts.get("flow", {})), steps)

    def _restored_flow(self, stored: dict[str, Any]) -> Flow:
        known = conditions(self.case, self.schedule)
        if self.thermal is not None:
            return self._with_dispersion(Flow(self.thermal.flow, self.strip.cell, known), stored)
        if "done" in stored:
            marched = MarchedFlow(self.case, self.strip, self.bed_motion, self.schedule)
            marched.restore(stored["fields"], int(stored["done"]))
            return Flow(marched, self.strip.cell, known)
        rests = begins_at_rest(self.case, self.schedule)
        cyclic = CyclicFlow.restored(self.strip, stored["fields"], rests)
        return self._with_dispersion(Flow(cyclic, self.strip.cell, known), stored)

    def _with_dispersion(self, flow: Flow, stored: dict[str, Any]) -> Flow:
        if "dispersion" not in stored:
            return flow
        dispersion = stored["dispersion"][:, :, self.strip.cell]
        return replace(
            flow,
            dispersion=dispersion,
            dispersed_in=dispersion_conditions(self.case, self.transport.diffusivities),
        )
