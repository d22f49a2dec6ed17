"""What is recorded while a box runs: bulk velocity, gap, contacts, voidage and velocity over height, trajectories."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mpm.arrays import Floats
from mpm.errors import ConvergenceError

from .gas import slab_solids
from .spec import BoxSpec, Particles

Arrays = dict[str, Floats]
"""What a `Recorder` holds of one seed, by name."""
BIN = 0.5  # height of a bin of the maps, in mean diameters
COLLAPSED = (
    0.2  # overlap over contact distance that no spring of a bed explains: beds that land reach 0.05 at 3 N/m
)
GAP_RANKS = (0.05, 0.20)  # ranks in height of the particles whose rise measures the gap


def wrapped(position: Floats, size: Floats) -> Floats:
    """`position` (n, 3) with x and y in [0, size), size (2,).

    The remainder of a small negative number rounds to the size of the box itself, which the periodic search refuses:
    it is the same place as 0.
    """
    inside = position.copy()
    inside[:, :2] %= size
    inside[:, :2] = np.where(inside[:, :2] < size, inside[:, :2], 0.0)
    return inside


def count_contacts(spec: BoxSpec, particles: Particles) -> tuple[int, int, float]:
    """(particle pairs in contact, particles touching the base, largest overlap over contact distance)."""
    size = np.array([spec.length, spec.depth])
    position = wrapped(particles.position, size)
    radius = spec.diameters[particles.classes] / 2.0
    period = [spec.length, spec.depth, 0.0]
    tree = cKDTree(position, boxsize=period)
    pairs = tree.query_pairs(float(2.0 * radius.max()), output_type="ndarray")
    touching, worst = _touch(
        position[pairs[:, 0]], position[pairs[:, 1]], contact=radius[pairs].sum(axis=1), size=size
    )
    if spec.base.flat:
        on_base = position[:, 2] < radius
    else:
        frit = cKDTree(wrapped(spec.base.positions, size), boxsize=period)
        reach = float(radius.max()) + spec.base.diameter / 2.0
        links = tree.sparse_distance_matrix(frit, reach, output_type="coo_matrix")
        near = links.data < radius[links.row] + spec.base.diameter / 2.0
        on_base = np.zeros(len(position), dtype=bool)
        on_base[links.row[near]] = True
    return int(touching), int(on_base.sum()), worst


def _touch(a: Floats, b: Floats, *, contact: Floats, size: Floats) -> tuple[int, float]:
    offset = a - b
    offset[:, :2] -= size * np.round(offset[:, :2] / size)
    overlap = 1.0 - np.linalg.norm(offset, axis=1) / contact
    return int((overlap > 0.0).sum()), float(overlap.max(initial=0.0))


class Recorder:
    """Collects samples of one seed; lives on rank 0. All arrays grow along their first axis, in time."""

    def __init__(self, spec: BoxSpec, velocity_limit: float, base_velocity: Callable[[float], Floats]):
        self.spec = spec
        self.limit = velocity_limit
        self.base_velocity = base_velocity
        d = spec.powder.diameter
        self.edges = np.arange(0.0, spec.height + BIN * d, BIN * d)
        self.data: dict[str, list[Floats | float]] = {
            name: []
            for name in (
                "velocity",
                "gap_height",
                "pairs",
                "on_base",
                "solid",
                "layer_velocity",
                "spread",
                "cycle_end",
            )
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        for name in self.data:
            self.data[name] = list(arrays[name])

    def arrays(self) -> Arrays:
        """velocity (n, 2) lab frame [m/s]; gap_height (n,) [m]; pairs, on_base (n,) per particle; solid and
        layer_velocity (n, bins): solid fraction and lab-frame velocity along the base; spread (n, 3): variances
        of the particles' velocities [m2/s2]; cycle_end (cycles + 1, particles, 3) [m]; edges, mass."""
        out = {name: np.array(values) for name, values in self.data.items()}
        out["edges"] = self.edges
        return out

    def check(self, particles: Particles, cycle: float) -> None:
        """Raise ConvergenceError when speeds have become impossible for this motion."""
        speed = float(np.linalg.norm(particles.velocity, axis=1).max())
        if not speed < self.limit:
            raise ConvergenceError(
                f"the box exploded: energy grows, a particle reached {speed:.3g} m/s in cycle {cycle:.2f} while the "
                f"motion explains {self.limit:.3g} m/s at most; raise box.steps_per_collision "
                f"(now {self.spec.steps:g}) or box.stiffness (now {self.spec.stiffness:g} N/m)"
            )

    def sample(self, time: float, particles: Particles) -> None:
        spec = self.spec
        diameter = spec.diameters[particles.classes]
        mass = diameter**3 / (diameter**3).sum()
        base = self.base_velocity(time)
        along = particles.velocity[:, 0] + base[0]
        self.data["velocity"].append(np.array([mass @ along, mass @ particles.velocity[:, 2] + base[1]]))
        low = np.sort(particles.position[:, 2])
        first, last = (int(rank * len(low)) for rank in GAP_RANKS)
        self.data["gap_height"].append(float(low[first : max(last, first + 1)].mean()))
        pairs, on_base, worst = count_contacts(spec, particles)
        if worst > COLLAPSED:
            raise ConvergenceError(
                f"the box collapsed: two particles overlap by {worst:.0%} of their contact distance; "
                f"raise box.stiffness (now {spec.stiffness:g} N/m)"
            )
        self.data["pairs"].append(pairs / len(diameter))
        self.data["on_base"].append(on_base / len(diameter))
        solids = slab_solids(height=particles.position[:, 2], diameter=diameter, edges=self.edges)
        self.data["solid"].append(solids / (spec.length * spec.depth * np.diff(self.edges)))
        index = np.clip(np.digitize(particles.position[:, 2], self.edges) - 1, 0, len(self.edges) - 2)
        weight = np.bincount(index, mass, len(self.edges) - 1)
        carried = np.bincount(index, mass * along, len(self.edges) - 1)
        self.data["layer_velocity"].append(
            np.divide(carried, weight, out=np.zeros_like(weight), where=weight > 0)
        )
        self.data["spread"].append(particles.velocity.var(axis=0))

    def end_cycle(self, particles: Particles) -> None:
        self.data["cycle_end"].append(particles.position.copy())
