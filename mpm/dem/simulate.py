"""One seed of a powder file: fill, settle, shake, record; restartable at the end of every cycle."""

import io
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.constants import GRAVITY
from mpm.errors import ConvergenceError, InputError
from mpm.files import load_arrays, write_atomically

from .base import FLAT, Base, Filling, fit_length, frit_monolayer, loose_filling, sawtooth_baffle
from .box import Box
from .case import DemCase
from .gas import GasDrag, slab_solids
from .sampling import Arrays, Recorder
from .screen import cycles_done, settling
from .spec import BoxSpec, Particles
from .waveform import Waveform

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

SETTLING_DRAG = 0.8
"""Rate of the viscous damping while the filling settles, times sqrt(d/g): particles sink at 1.25 sqrt(g d) at most, too slow to bounce."""
SETTLE_BLOCKS = 60
"""Of half of sqrt(d/g), at most: a particle sinks by 37 diameters in them."""
AT_REST = 0.005
"""Root mean square speed over sqrt(g d) at which the filling has settled: with that energy it would rise by 1e-5 diameters."""
CLEARANCE, THROWS = 10.0, 8.0
"""Room above the filling: diameters, and heights to which the largest speed of the base throws a particle."""
TOO_FAST = 20.0
"""Speed over that of base and fall through the bed together that no collision explains; an unstable integration soon passes any bound."""
Stored = Mapping[str, NDArray[Any]]
"""The arrays of a state file."""
Progress = Callable[[float, str], None]  # called with the number of cycles done and what is being done


def build(case: DemCase, seed: int) -> tuple[BoxSpec, Filling]:
    """The box of a powder file and its loose filling for one seed."""
    powder, options = case.build_powder(), case.box
    d = powder.diameter
    diameters = case.diameters()
    length, depth, base = options.length * d, options.depth * d, FLAT
    if options.base != "flat":
        length, depth = (fit_length(size, options.frit_diameter) for size in (length, depth))
        base = _glued(case, length, depth)
    filling = loose_filling(
        length=length, depth=depth, height=options.height * d, diameters=diameters, base=base, seed=seed
    )
    thrown = fastest(case.build_waveform(), 1.0) ** 2 / (2.0 * GRAVITY)
    spec = BoxSpec(
        powder=powder,
        diameters=diameters,
        length=length,
        depth=depth,
        height=float(filling.positions[:, 2].max()) + CLEARANCE * d + THROWS * thrown,
        base=base,
        stiffness=options.stiffness,
        cohesion=options.cohesion,
        steps=options.steps_per_collision,
        reduced=options.reduced_cohesion,
    )
    return spec, filling


def fastest(waveform: Waveform, span: float) -> float:
    """Largest component of the base's velocity [m/s] within `span` [s] from the start."""
    return float(np.abs(waveform.velocity(np.linspace(0.0, span, 4001))).max())


def _glued(case: DemCase, length: float, depth: float) -> Base:
    options = case.box
    if options.base == "frit":
        return frit_monolayer(length=length, depth=depth, diameter=options.frit_diameter)
    return sawtooth_baffle(
        length=length,
        depth=depth,
        diameter=options.frit_diameter,
        height=options.baffle_height,
        width=options.baffle_width,
    )


def stored_particles(state: Stored) -> Particles:
    """The bed in a state file."""
    return Particles(
        position=state["position"], velocity=state["speed"], spin=state["spin"], classes=state["classes"]
    )


class Simulation:
    """Runs one seed in `directory`; every rank of `comm` takes part, rank 0 records and writes."""

    def __init__(self, case: DemCase, seed: int, directory: Path, comm: "Comm | None" = None):
        self.case, self.seed, self.directory, self.comm = case, seed, directory, comm
        self.rank = comm.rank if comm is not None else 0
        self.spec, self.filling = build(case, seed)
        self.waveform: Waveform = case.build_waveform()
        self.period = 1.0 / self.waveform.frequency
        self.update = self.period / case.run.updates_per_cycle
        self.steps = max(1, math.ceil(self.update / self.spec.largest_timestep()))
        self.timestep = self.update / self.steps
        powder, gas = self.spec.powder, case.gas
        self.gas = (
            None
            if gas is None
            else GasDrag(
                powder=powder,
                viscosity=gas.viscosity,
                density=gas.density,
                velocity=gas.velocity,
                rests_in_lab=gas.frame == "lab",
            )
        )
        drop = math.sqrt(2.0 * GRAVITY * case.box.height * powder.diameter)
        limit = TOO_FAST * (fastest(self.waveform, self.period) + drop)
        self.recorder = Recorder(self.spec, limit, lambda t: self.waveform.velocity(np.array([t]))[:, 0])

    @property
    def state_file(self) -> Path:
        return self.directory / "state.npz"

    def run(self, resume: bool = False, progress: Progress = lambda done, doing: None) -> Arrays | None:
        """Simulate up to the case's number of cycles; returns the recorder's arrays on rank 0."""
        if self.rank == 0:
            self.directory.mkdir(parents=True, exist_ok=True)
        saved = self._load() if resume else None
        done = 0 if saved is None else int(saved["cycles"])
        if saved is not None:
            self.recorder.restore(saved)
            if done >= self.case.run.cycles:
                return self.load_arrays() if self.rank == 0 else None
            start = stored_particles(saved)
        else:
            start = Particles.at_rest(self.filling.positions, self.filling.classes)
        with Box(self.spec, start, self.timestep, self.directory, self.comm) as box:
            if saved is None:
                self._settle(box, progress)
                self._end_cycle(box, 0)
            if self.gas is not None:
                box.enable_drag()
            every = self.case.run.dump_per_cycle
            if every:
                stride = max(1, self.case.run.updates_per_cycle // every) * self.steps
                box.dump(self.directory / "trajectory.lammpstrj", stride, append=saved is not None)
            for cycle in range(done, self.case.run.cycles):
                self._cycle(box, cycle, progress)
                self._end_cycle(box, cycle + 1)
                self._tell(progress, cycle + 1.0)
        return self.recorder.arrays() if self.rank == 0 else None

    def _tell(self, progress: Progress, done: float) -> None:
        progress(done, cycles_done(done, self.case.run.cycles))

    def _settle(self, box: Box, progress: Progress) -> None:
        """Let the filling fall under gravity and viscous damping until it rests."""
        d = self.spec.powder.diameter
        fall = math.sqrt(d / GRAVITY)
        box.accelerate(0.0, -GRAVITY)
        box.set_damping(SETTLING_DRAG / fall)
        block = max(1, round(0.5 * fall / self.timestep))
        for _ in range(SETTLE_BLOCKS):
            box.run(block)
            state = box.snapshot()
            rest = False
            if state is not None:
                speed = float(np.sqrt((state.velocity**2).sum(axis=1).mean()))
                rest = speed < AT_REST * GRAVITY * fall
                progress(0.0, settling(speed, AT_REST * GRAVITY * fall))
            if self.comm is not None:
                rest = self.comm.bcast(rest, root=0)
            if rest:
                break
        box.set_damping(None)

    def _cycle(self, box: Box, cycle: int, progress: Progress) -> None:
        run = self.case.run
        tilt = self.case.box.declination
        gravity = np.array([GRAVITY * math.sin(tilt), -GRAVITY * math.cos(tilt)])
        every = run.updates_per_cycle // run.samples_per_cycle
        times = (cycle + np.arange(run.updates_per_cycle + 1) / run.updates_per_cycle) * self.period
        # the mean acceleration of an interval: velocities of the base are exact at its ends
        base = self.waveform.velocity(times)
        inertial = gravity[:, None] - np.diff(base, axis=1) / self.update
        for i in range(run.updates_per_cycle):
            box.accelerate(float(inertial[0, i]), float(inertial[1, i]))
            if self.gas is not None:
                self._refresh_drag(box, self.gas, self.gas.flux(float(base[1, i : i + 2].mean())))
            box.run(self.steps)
            if (i + 1) % every == 0:
                now = cycle + (i + 1) / run.updates_per_cycle
                self._record(box, float(times[i + 1]), now)
                self._tell(progress, now)

    def _record(self, box: Box, time: float, cycle: float) -> None:
        """Check and sample on rank 0; an impossible state is raised by every rank."""
        failure: ConvergenceError | None = None
        state = box.snapshot()
        if state is not None:
            try:
                self.recorder.check(state, cycle)
                self.recorder.sample(time, state)
            except ConvergenceError as error:
                failure = error
        if self.comm is not None:
            failure = self.comm.bcast(failure, root=0)
        if failure is not None:
            raise failure

    def _refresh_drag(self, box: Box, gas: GasDrag, flux: float) -> None:
        height, velocity, diameter = box.local_bed()
        bed = box.local_is_bed()
        edges = gas.edges(self.spec.height)
        solid = slab_solids(height=height[bed], diameter=diameter[bed], edges=edges)
        if self.comm is not None:
            solid = self.comm.allreduce(solid)
        solid = solid / (self.spec.length * self.spec.depth * np.diff(edges))
        gamma = np.zeros(len(height))
        gamma[bed] = gas.coefficients(
            height=height[bed],
            relative=flux - velocity[bed],
            diameter=diameter[bed],
            edges=edges,
            solid=solid,
        )
        box.set_drag(gamma, flux)

    # State ----------------------------------------------------------------------------------------

    def _end_cycle(self, box: Box, cycles: int) -> None:
        """Record the positions and write the state: particles, recorder, number of cycles."""
        state = box.snapshot()
        if state is None:
            return
        self.recorder.end_cycle(state)
        arrays: dict[str, Any] = {
            **self.recorder.arrays(),
            "position": state.position,
            "speed": state.velocity,
            "spin": state.spin,
            "classes": state.classes,
            "cycles": np.array(cycles),
            "case": np.array(self.case.content_hash()),
        }
        stream = io.BytesIO()
        np.savez(stream, **arrays)
        write_atomically(self.state_file, stream.getvalue())

    def _load(self) -> Stored | None:
        """The saved state, None when there is none. Every rank reads it."""
        if not self.state_file.exists():
            return None
        saved = load_arrays(self.state_file, "the state of a powder run of mpm")
        if str(saved["case"]) != self.case.content_hash():
            raise InputError(
                f"{self.directory}: holds another powder file's run; only seeds, cycles, discard and the profile "
                "may change on --resume"
            )
        return saved

    def load_arrays(self) -> Arrays:
        """The recorder's arrays of a finished seed, up to the case's number of cycles."""
        saved = self._load()
        if saved is None or int(saved["cycles"]) < self.case.run.cycles:
            raise InputError(f"{self.directory}: this seed is not finished; go on with --resume")
        return self._cut({name: saved[name] for name in (*self.recorder.data, "edges")})

    def _cut(self, arrays: Arrays) -> Arrays:
        """Leave out cycles beyond the number that is asked for."""
        cycles = self.case.run.cycles
        samples = cycles * self.case.run.samples_per_cycle
        return {
            name: values if name == "edges" else values[: cycles + 1 if name == "cycle_end" else samples]
            for name, values in arrays.items()
        }
