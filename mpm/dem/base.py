"""What the bed lies on, and how it is filled: glued frit particles, baffles, the loose packing to settle."""

import math
from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats, Ints


@dataclass(frozen=True)
class Base:
    """Frozen particles of one diameter at `positions` (n, 3) [m]; n = 0 means a flat wall at z = 0."""

    positions: Floats
    diameter: float

    @property
    def flat(self) -> bool:
        return len(self.positions) == 0

    @property
    def top(self) -> float:
        """Highest point above z = 0 [m]."""
        return 0.0 if self.flat else float(self.positions[:, 2].max() + self.diameter / 2.0)


SETTLED = 0.6
"""Solid fraction of a bed at rest, for counting the particles that fill a height."""
FLAT = Base(np.zeros((0, 3)), 0.0)


def fit_length(length: float, diameter: float) -> float:
    """The multiple of `diameter` nearest to `length`, so that a glued layer closes over the seam."""
    return max(3, round(length / diameter)) * diameter


def frit_monolayer(*, length: float, depth: float, diameter: float) -> Base:
    """One layer of simple cubic packing with its top at z = 0 (section 3.3.4); length, depth: multiples of d."""
    x = (np.arange(round(length / diameter)) + 0.5) * diameter
    y = (np.arange(round(depth / diameter)) + 0.5) * diameter
    grid = np.stack(np.meshgrid(x, y, [-diameter / 2.0], indexing="ij"), axis=-1)
    return Base(grid.reshape(-1, 3), diameter)


def sawtooth_baffle(*, length: float, depth: float, diameter: float, height: float, width: float) -> Base:
    """A monolayer with one sawtooth: up over `width` along +x, then a vertical fall of `height` (chapter 4).

    The face starts where the tooth begins, at (length - width)/2; particles are spaced by their diameter or
    slightly less, so that nothing falls between them.
    """
    start = (length - width) / 2.0
    floor = frit_monolayer(length=length, depth=depth, diameter=diameter).positions
    hypotenuse = math.hypot(width, height)
    rise = np.linspace(0.0, 1.0, math.ceil(hypotenuse / diameter) + 1)
    fall = np.linspace(1.0, 0.0, math.ceil(height / diameter) + 1)[1:]
    x = np.concatenate([start + width * rise, np.full(fall.size, start + width)])
    z = np.concatenate([height * rise, height * fall]) - diameter / 2.0
    y = np.unique(floor[:, 1])
    tooth = np.stack([np.repeat(x, y.size), np.tile(y, x.size), np.repeat(z, y.size)], axis=-1)
    under = (floor[:, 0] > start + diameter / 2) & (floor[:, 0] < start + width - diameter / 2)
    return Base(np.concatenate([floor[~under], tooth]), diameter)


def tooth_area(base: Base) -> float:
    """Area of the (x, z) section that a baffle takes from the bed [m2]; zero for flat bases."""
    if base.flat or base.top <= 0.0:
        return 0.0
    raised = base.positions[base.positions[:, 2] > -base.diameter / 2.0]
    return 0.5 * float(np.ptp(raised[:, 0])) * base.top


@dataclass(frozen=True)
class Filling:
    """Particles before settling: centres (n, 3) [m] and size classes (n,) counted from 0."""

    positions: Floats
    classes: Ints


def loose_filling(
    *, length: float, depth: float, height: float, diameters: Floats, base: Base, seed: int
) -> Filling:
    """A jittered lattice above the base that settles to about `height` (at the solid fraction SETTLED).

    `seed` sets the jitter and the order of the sizes. No two particles touch.
    """
    rng = np.random.default_rng(seed)
    volume = SETTLED * depth * (length * height - tooth_area(base))
    count = max(1, round(volume / (math.pi / 6.0 * float((diameters**3).mean()))))
    classes = rng.permutation(np.arange(count) % len(diameters))
    largest = float(diameters.max())
    spacing, jitter = 1.12 * largest, 0.05 * largest  # at least 1.02 of the largest apart
    nx, ny = max(1, int(length / spacing)), max(1, int(depth / spacing))
    layers = math.ceil(count / (nx * ny))
    k, j, i = np.meshgrid(np.arange(layers), np.arange(ny), np.arange(nx), indexing="ij")
    sites = np.stack(
        [(i.ravel() + 0.5) * length / nx, (j.ravel() + 0.5) * depth / ny, k.ravel() * spacing], axis=-1
    )
    # The topmost layer is rarely full: leave its empty sites anywhere, not all on one side.
    last = (layers - 1) * nx * ny
    sites[last:] = sites[last + rng.permutation(nx * ny)]
    positions = sites[:count] + rng.uniform(-jitter, jitter, (count, 3))
    positions[:, 2] += base.top + 0.6 * largest
    return Filling(positions, classes)
