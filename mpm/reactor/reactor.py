"""The reactor: puts mesh, motion, flow, bed and transport together and marches them in time.

result = Reactor(load_case("single_zone")).run("results/zone")
result.summary["titration"]["tma"]["exit_mean"]
"""

from __future__ import annotations

import logging
import time as clock
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.advice.checks import check_case
from mpm.case.keys import values
from mpm.errors import ConvergenceError, InputError, Interrupted, StorageError, printable, storage_error
from mpm.flow.numbers import flux_profiles
from mpm.mesh.grid import Grid
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion, step_motion
from mpm.motion.schedule import Schedule, Step
from mpm.numerics import fem
from mpm.output.directory import FAILED, RunDirectory
from mpm.output.history import Row, columns_of
from mpm.output.phases import LastCycle, phase_fields
from mpm.parallel import is_root, largest, on_root, total
from mpm.reactor import checkpoint
from mpm.reactor.progress import FLOW, Progress, log_file
from mpm.reactor.result import Result as Result
from mpm.reactor.sequence import March, Replay
from mpm.reactor.steady import steady_problem
from mpm.reactor.summary import history_row, summarise
from mpm.report.balances import LIMIT, require_balance, worst_balance
from mpm.report.records import State, Totals
from mpm.signals import stop_signals
from mpm.transport.coverage import Bed
from mpm.transport.dispersion import vibrational_dispersion
from mpm.transport.species import Transport

from mpi4py import MPI  # isort: skip  (after fem)

if TYPE_CHECKING:
    from mpm.case.case import Case

Floats = NDArray[np.float64]
log = logging.getLogger("mpm")
Callback = Callable[["Reactor"], None]


class Reactor:
    """One case on the ranks of `comm`.

    `time` [s] and `steps` done so far; `numbers` is the latest row of the history. `field`, `coverage` and `totals` are collective: every
    rank calls them and gets the whole.
    """

    def __init__(self, case: Case, comm: MPI.Comm = MPI.COMM_WORLD):
        self.case, self.comm = case, comm
        on_root(comm, fem.check_cache)
        self.identity = checkpoint.identity(case)  # now: the profile's file may change while the run goes on
        self.grid = Grid.from_case(case)
        self.schedule = Schedule.from_case(case)
        self.last_cycle = LastCycle.of(case, self.schedule)
        self.strip = Strip(case, comm)
        self.motion = BedMotion(case.motion)
        self.bed = Bed(case, self.strip)
        self.transport = Transport(case, self.strip, self.bed)
        self.flows: Replay | March | None = None
        self.time, self.steps, self.wall_before = 0.0, 0, 0.0
        self.begun = clock.monotonic()
        self.numbers: dict[str, float] = {}
        self.rows: list[dict[str, float]] = []
        self.sites_initially = total(comm, self.bed.content())
        self.stored_initially = total(comm, self.transport.concentration @ self.transport.gas_volume)
        self.before: Totals | None = None
        self.kept: float | None = None  # time of the restart state on disk [s]
        self.phases_lost = 0  # phases of the last cycle before that state that were not written: it was not the last cycle then
        self._stop = False

    # --- running ---

    def run(
        self,
        output: str | Path | None = None,
        callback: Callback | None = None,
        resume: bool = False,
        overwrite: bool = False,
        progress: bool | None = None,
    ) -> Result:
        """March to the end of the case, calling `callback(reactor)` at every output time.

        `progress`: show how it gets on; by default where somebody watches, on a terminal or in a notebook.

        With `output`, everything the run writes goes there; `resume` continues from its restart state. Raises InputError (directory,
        changed case), ConvergenceError, StorageError (full disk) and Interrupted; after the last three the directory is usable and can be
        resumed.
        """
        self.begun = clock.monotonic()
        directory = RunDirectory(output) if output is not None else None
        try:
            if directory is not None:
                self._open(directory, resume, overwrite)
            return self._run(directory, callback, progress)
        except OSError as error:
            raise self._explain(error) from error
        finally:
            if directory is not None:
                directory.release()

    def _run(
        self, directory: RunDirectory | None, callback: Callback | None, progress: bool | None
    ) -> Result:
        file = directory.log if directory is not None and is_root(self.comm) else None
        with log_file(log, file), Progress(self, progress) as bar, stop_signals(self._request_stop):
            log.info(
                "%s: %s, %d cells, %d ranks",
                printable(self.case.title),
                self.case.fidelity,
                self.grid.cells,
                self.comm.size,
            )
            for warning in check_case(self.case)["warnings"]:
                log.warning("warning: %s", warning)
                bar.warn(warning)
            if self.case.fidelity == "steady":
                return self._run_steady(directory, callback, bar)
            try:
                if self.kept is not None:
                    log.info("resumed at t = %g s, after step %d", self.time, self.steps)
                    self._tell_lost_phases(bar)
                else:
                    self._start(bar)
                    log.info("flow found after %.1f s", self.wall)
                    self._write(directory, callback, None)
                    if directory is not None:
                        self._keep(directory)  # the flow may have taken minutes
                self._march(directory, callback, bar)
                require_balance(self.case, self.totals())
            except (ConvergenceError, Interrupted) as error:
                self._give_up(directory, error)
                raise
        summary = summarise(self, "done", self.wall)
        self._write_numbers(directory, summary)
        return Result(self, summary, None if directory is None else directory.path)

    def _tell_lost_phases(self, bar: Progress) -> None:
        if self.phases_lost > 0:
            text = (
                f"output.phases: {self.phases_lost} of the {self.case.output.phases} phases of the last cycle lie before "
                f"t = {self.time:g} s, where this run goes on, and were not written"
            )
            log.warning("warning: %s", text)
            bar.warn(text)

    @property
    def wall(self) -> float:
        """Wall time so far [s], of the parts before a restart too."""
        return self.wall_before + clock.monotonic() - self.begun

    def _explain(self, error: OSError) -> Exception:
        """What a full or closed disk means for the run; the error itself when it is about something else."""
        said = storage_error(error)
        if isinstance(said, StorageError) and self.kept is not None:
            said = StorageError(
                f"{said}; the restart state at t = {self.kept:.6g} s is whole: make room and go on with --resume"
            )
        return said or error

    def _open(self, directory: RunDirectory, resume: bool, overwrite: bool) -> None:
        """Prepare the directory on rank 0 and read a restart state into every rank."""

        def prepare() -> Any:
            directory.prepare(resume=resume, overwrite=overwrite)
            state = directory.read_checkpoint() if resume else None
            if resume:
                checkpoint.check_same_case(directory, self.case, state)
            directory.write_case(self.case.to_toml())
            if not resume:  # a resumed case is the resolved one, in which everything is typed
                directory.write_origin({value.name: value.origin for value in values(self.case)})
            return state

        state = on_root(self.comm, prepare)
        if state is not None:
            checkpoint.restore(self, *state)
            self.kept, rows = self.time, state[1]["rows"]

            def cut_back() -> tuple[list[Row], int]:
                directory.cut_back(rows, self.time, self.last_cycle.since)
                return list(directory.table.rows), len(directory.phases.steps)

            self.rows, phases = on_root(self.comm, cut_back)
            self.phases_lost = self.last_cycle.passed(self.schedule, self.steps) - phases
            self.numbers = self.rows[-1] if self.rows else {}
        elif resume:
            on_root(self.comm, lambda: directory.cut_back(0, 0.0))

    def _start(self, bar: Progress) -> None:
        """Find the flow of a fresh run, unless it was handed over."""
        if self.flows is None:
            bar.say(FLOW)
            self.flows = self._find_flow(bar)
        self.flows.register(self.transport)

    def _find_flow(self, bar: Progress) -> Replay | March:
        if self.case.fidelity == "resolved" and self.case.motion.startup == "impulsive":
            return March(self.case, self.strip, self.motion, self.schedule)

        def watch(cycle: int, change: float) -> None:
            bar.say(f"{FLOW}: cycle {cycle + 1}, relative change {change:.0e}")
            self._check_stop()

        flows = Replay.solve(self.case, self.strip, self.motion, self.schedule, watch)
        if self.case.transport.vibrational_dispersion:
            flows.dispersion = vibrational_dispersion(
                self.case, self.strip, self.motion, self.transport.diffusivities, watch
            )
        return flows

    def _run_steady(self, directory: RunDirectory | None, callback: Callback | None, bar: Progress) -> Result:
        """Find the quasi-steady state; the last iterate is written when that fails or is out of balance."""

        def watch(iteration: int, residual: float) -> None:
            bar.say(f"steady state, Newton step {iteration}, residual {residual:.0e} of the feed")
            self._check_stop()

        error: ConvergenceError | Interrupted | None = None
        try:
            self._start(bar)
        except (ConvergenceError, Interrupted) as stopped:
            _log_end(stopped)
            raise
        problem = steady_problem(self, 0, watch)
        try:
            problem.solve()
        except (ConvergenceError, Interrupted) as stopped:
            error = stopped
        try:
            problem.settle_accounts()
            self.steps = problem.iterations
            self.sites_initially = total(self.comm, self.bed.content())
            self.stored_initially = total(self.comm, self.transport.concentration @ self.transport.gas_volume)
            require_balance(self.case, self.totals())
        except ConvergenceError as unsettled:
            error = error or unsettled
        if error is not None:
            _log_end(error)
        status = "done" if error is None else "interrupted" if isinstance(error, Interrupted) else "failed"
        self._write(directory, callback if error is None else None, None)
        summary = summarise(self, status, self.wall)
        self._write_numbers(directory, summary)
        if error is not None:
            raise error
        return Result(self, summary, None if directory is None else directory.path)

    def _march(self, directory: RunDirectory | None, callback: Callback | None, bar: Progress) -> None:
        """All steps to the end of the case.

        What happens only because the run ends here, a cut step and a row between two output times, comes after the last restart state: a
        run resumed with a later end is the run of that length.
        """
        assert self.flows is not None
        last_checkpoint, every = clock.monotonic(), self.case.output.every
        step = self.schedule.step(max(self.schedule.steps - 1, 0))
        for step in self.schedule.from_step(self.steps):
            if step.cut and directory is not None:
                self._keep(directory)
            self._take(step)
            bar.advance()
            if self.schedule.is_output(step, every):
                self._write(directory, callback, step)
                log.info("%s", bar.line())
            self._write_phase(directory, step)
            if self.steps == self.schedule.steps:
                break
            due = clock.monotonic() - last_checkpoint > self.case.output.checkpoint
            stop, due = largest(self.comm, [self._stop, due and is_root(self.comm)]) > 0.0
            if due and directory is not None:
                self._keep(directory)
                last_checkpoint = clock.monotonic()
            if stop:
                raise Interrupted(f"interrupted at t = {self.time:.6g} s, after step {self.steps}")
        if directory is not None and not step.cut:
            self._keep(directory)
        if self.rows[-1]["time"] != self.time:
            self._write(directory, callback, step)

    def _take(self, step: Step) -> None:
        """One step: the bed slides, then gas and coverage follow over the new position."""
        assert self.flows is not None
        memento = self.bed.memento()
        try:
            number = self.flows.number(step, self.transport)
            self.bed.advance(self._slide(step))
            self.transport.advance(number, step.t0, step.dt)
        except ConvergenceError as error:
            self.bed.recall(memento)
            raise ConvergenceError(f"step {step.index + 1}: {error}") from error
        self.time, self.steps = step.t1, step.index + 1

    def _slide(self, step: Step) -> float:
        """How far the bed slides over the mesh during `step` [m]: with the mean velocity where the flow is a mean, too.

        Steps that sample the vibration only now and then would shake some columns back into a cell and hurry others past it.
        """
        if step.since < 0.0:
            return 0.0
        if self.schedule.phases == 1:
            return self.motion.mean * step.dt
        return step_motion(self.motion, step.since, step.since + step.dt).slide

    def _check_stop(self) -> None:
        if largest(self.comm, [self._stop])[0] > 0.0:
            raise Interrupted(
                "interrupted while the flow was being found; nothing but the case has been written"
            )

    def _request_stop(self) -> None:
        self._stop = True

    # --- writing ---

    def _write(self, directory: RunDirectory | None, callback: Callback | None, step: Step | None) -> None:
        """Record an output time: a row of the history, the fields, the callback."""
        totals = self.totals()
        self.numbers = history_row(self.case, self.grid, self.time, totals, self.state(), self.before)
        self.before = totals
        self.rows.append(self.numbers)
        if directory is not None:
            fields = self.fields(step)

            def write() -> None:
                directory.append_history(self.numbers)
                directory.write_fields(self.time, self.grid, fields)

            on_root(self.comm, write)
        if callback is not None:
            callback(self)

    def _write_phase(self, directory: RunDirectory | None, step: Step) -> None:
        """Write what `step` has led to when it is one of the wanted phases of the last cycle."""
        number = self.last_cycle.number(step)
        if directory is None or number is None:
            return
        usual = self.fields(step)

        def write() -> None:
            fields = phase_fields(usual, self.case, self.grid, self.motion, step)
            moved = self.motion.vibration.displacement(step.since + step.dt)
            directory.phases.write(self.time, self.grid, fields, moved, number)

        on_root(self.comm, write)

    def _keep(self, directory: RunDirectory) -> None:
        """Write the restart state. Raises BalanceError when it is out of balance: then the last good one stays."""
        require_balance(self.case, self.totals())
        checkpoint.write(self, directory)
        self.kept = self.time

    def _give_up(self, directory: RunDirectory | None, error: Exception) -> None:
        """Keep the last good state and say in summary.json how the run ended."""
        _log_end(error)
        if directory is None or self.flows is None:
            return
        status = "interrupted" if isinstance(error, Interrupted) else "failed"
        if worst_balance(self.case, self.totals())[1] <= LIMIT:
            checkpoint.write(self, directory)
        self._write_numbers(directory, summarise(self, status, self.wall))

    def _write_numbers(self, directory: RunDirectory | None, summary: dict[str, Any]) -> None:
        """Write the summary, and the flux of the mean flow along the strip."""
        if directory is None or self.flows is None:
            return
        profiles = flux_profiles(self.strip, self.flows.mean())

        def write() -> None:
            directory.write_flux(profiles)
            directory.write_summary(summary)

        on_root(self.comm, write)

    # --- looking ---

    def history(self) -> dict[str, Floats]:
        """Columns of the history; NaN where a row lacks one."""
        return columns_of(self.rows)

    def totals(self) -> Totals:
        """What has passed so far, summed over all ranks; collective."""
        transport, bed, comm, grid = self.transport, self.bed, self.comm, self.grid
        ledger = transport.ledger
        passed = (ledger.fed, ledger.out, ledger.back, ledger.out_volume, ledger.back_volume)
        fed, out, back, volume, back_volume = (total(comm, v) for v in passed)
        surface = bed.scatter.to_all(ledger.surface_events)
        zones = grid.zone_of_column[self.strip.column[: self.strip.owned]]
        count = len(self.case.geometry.zones) + 1
        gas = np.array([np.bincount(zones, e, count) for e in ledger.gas_events]).reshape(-1, count)
        return Totals(
            names=transport.names,
            fed=fed,
            out=out,
            back=back,
            out_volume=volume,
            back_volume=back_volume,
            stored=total(comm, transport.concentration @ transport.gas_volume),
            stored_initially=self.stored_initially,
            surface=surface.reshape(len(ledger.surface_events), len(bed.rows), grid.columns),
            gas=total(comm, gas),
            reactive_rows=bed.rows,
            slid=bed.distance,
            sites=total(comm, bed.content()),
            sites_initially=self.sites_initially,
            sites_passed=bed.passed.copy(),
        )

    def state(self) -> State:
        """Coverage, dosed species and gas reaction rates now; collective."""
        rate = self._cvd_rate()
        zones = self.grid.zone_of_column[self.strip.column[: self.strip.owned]]
        per_zone = np.bincount(zones, rate * self.transport.volume, len(self.case.geometry.zones) + 1)
        fed = {n for amounts in self.transport.feed.values() for n, c in amounts.items() if c > 0.0}
        dosed = [i for i, n in enumerate(self.transport.names) if n in fed]
        fields = self.strip.scatter.to_all(self.transport.concentration[dosed])
        fields = fields.reshape(-1, self.grid.rows, self.grid.columns)
        return State(
            theta=self.bed.whole(),
            reactive_rows=self.bed.rows,
            cvd=total(self.comm, per_zone),
            cvd_max=float(largest(self.comm, [rate.max(initial=0.0)])[0]),
            concentration={self.transport.names[i]: field for i, field in zip(dosed, fields, strict=True)},
        )

    def _cvd_rate(self) -> Floats:
        """Events of gas reactions per total volume in own cells [mol/m3/s]."""
        coupled = len(self.transport.roles.coupled)
        rates, _ = self.transport.gas.rates(self.transport.concentration[:coupled])
        return rates.sum(axis=0) * self.transport.porosity

    def _local_fields(self, step: Step | None) -> dict[str, Floats]:
        """Everything that can be shown, own cells: names as in the files."""
        assert self.flows is not None
        own = self.strip.owned
        concentration = dict(zip(self.transport.names, self.transport.concentration, strict=True))
        fields: dict[str, Floats] = {}
        whole = self.case.gas.molar_density
        carrier = np.ones(own)
        for name in self.case.mechanism.species_names:
            c = concentration.get(name, np.zeros(own))
            fields[f"C_{name}"], fields[f"x_{name}"] = c, c / whole
            carrier -= c / whole
        fields[f"x_{self.case.gas.carrier}"] = carrier
        for k, site in enumerate(self.case.mechanism.site_names):
            fields[f"theta_{site}"] = np.zeros(own)
            fields[f"theta_{site}"][self.bed.cells] = self.bed.theta[k]
        fields["cvd_rate"] = self._cvd_rate()
        flow = self.flows.field(step if step is not None else self.schedule.step(max(self.steps - 1, 0)))
        bottom, left, right, top = flow.velocities[:, :own]
        fields["velocity_x"], fields["velocity_y"] = 0.5 * (left + right), 0.5 * (bottom + top)
        fields["pressure"] = flow.pressure[:own]
        return fields

    def fields(self, step: Step | None = None) -> dict[str, Floats]:
        """All cell fields for the files, in the grid's order, on rank 0 (empty elsewhere); collective."""
        local = self._local_fields(step)
        values = self.strip.scatter.to_root(np.stack(list(local.values())))
        if values is None:
            return {}
        fields = dict(zip(local, values, strict=True))
        x, y = fields.pop("velocity_x"), fields.pop("velocity_y")
        return {**fields, "velocity": np.column_stack([x, y])}

    def field(self, name: str) -> Floats:
        """One cell field as (rows, columns) on every rank, or (rows, columns, 2) for `velocity`; collective.

        Names are those of the files: C_TMA, x_CH4, theta_OH, cvd_rate, velocity, pressure. Raises InputError for another.
        """
        local = self._local_fields(None)
        shape = (self.grid.rows, self.grid.columns)
        if name == "velocity":
            both = self.strip.scatter.to_all(np.stack([local["velocity_x"], local["velocity_y"]]))
            return np.moveaxis(both.reshape(2, *shape), 0, -1)
        if name not in local:
            raise InputError(
                f"no field {name!r}; there are velocity, {', '.join(n for n in local if 'velocity' not in n)}"
            )
        return self.strip.scatter.to_all(local[name]).reshape(shape)

    def coverage(self, layer: str, site: str) -> Floats:
        """Coverage of `site` in `layer` as (rows, columns), bottom row first; collective. Raises InputError for unknown names."""
        if layer not in self.grid.layer_names:
            raise InputError(f"no layer {layer!r}; there are {', '.join(self.grid.layer_names)}")
        if site not in self.case.mechanism.site_names:
            raise InputError(f"no site {site!r}; there are {', '.join(self.case.mechanism.site_names)}")
        rows = self.grid.layer_rows(layer)
        chosen = (self.bed.rows >= rows.start) & (self.bed.rows < rows.stop)
        return self.bed.whole()[self.case.mechanism.site_names.index(site)][chosen]


def _log_end(error: Exception) -> None:
    """The last line of the log of a run that ends early: all that is left of one that has failed before its first step."""
    log.error("%s%s", "" if isinstance(error, Interrupted) else FAILED, error)
