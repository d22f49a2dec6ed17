"""One velocity field of the gas, and what others read from it: at faces, in cells, through ports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.mesh.strip import BOTTOM, LEFT, RIGHT, TOP, Strip
from mpm.parallel import total

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.ports import Inlet
    from mpm.mesh.grid import Grid
    from mpm.parallel import Scatter


@dataclass(frozen=True, eq=False)
class FlowField:
    """Velocities at the bottom, left, right and top of every local cell (4, cells) [m/s] and pressure (cells,) [Pa]."""

    velocities: Floats
    pressure: Floats

    def in_cells(self, own: int) -> Floats:
        """Velocity at the centres of the first `own` cells, (2, own) [m/s]: the mean of opposite faces."""
        v = self.velocities[:, :own]
        return 0.5 * np.stack([v[LEFT] + v[RIGHT], v[BOTTOM] + v[TOP]])

    def stored(self, own: int) -> Floats:
        """Four velocities and the pressure of own cells, (5, own)."""
        return np.vstack([self.velocities[:, :own], self.pressure[None, :own]])

    @classmethod
    def restored(cls, strip: Strip, stored: Floats) -> FlowField:
        """The field of `stored` in grid order (5, cells), ghosts included."""
        return cls(np.ascontiguousarray(stored[:4, strip.cell]), stored[4, strip.cell].copy())


def stored_fields(fields: Sequence[FlowField], scatter: Scatter, own: int) -> Floats | None:
    """What `FlowField.restored` takes of each field, (fields, 5, cells) in grid order on rank 0, None elsewhere; collective.

    One field after another: those of a cycle are the largest arrays of a run.
    """
    whole = None
    for place, field in enumerate(fields):
        one = scatter.to_root(field.stored(own))
        if one is not None:
            whole = np.empty((len(fields), *one.shape)) if whole is None else whole
            whole[place] = one
    return whole


def mean_field(fields: Sequence[FlowField]) -> FlowField:
    """Mean of fields that each stand for equally long."""
    return FlowField(
        np.mean([f.velocities for f in fields], axis=0), np.mean([f.pressure for f in fields], axis=0)
    )


@dataclass(frozen=True, eq=False)
class FaceFlow:
    """Velocities normal to faces, positive along the axes [m/s]: `inner` in the order of `strip.faces`, `bottom` and `top` in that of
    `strip.wall_cells`."""

    inner: Floats
    bottom: Floats
    top: Floats

    def inward(self, side: str) -> Floats:
        """Velocity into the strip through the wall `side`."""
        return self.bottom if side == "bottom" else -self.top


def face_flow(strip: Strip, velocities: Floats) -> FaceFlow:
    """Face velocities of `velocities` (4, cells) as the transport needs them."""
    faces = strip.faces
    sides = np.where(faces.vertical_flow, TOP, RIGHT)
    bottom, top = strip.wall_cells("bottom"), strip.wall_cells("top")
    return FaceFlow(velocities[sides, faces.behind], velocities[BOTTOM, bottom], velocities[TOP, top])


def inlet_share(case: Case, grid: Grid, inlet: Inlet) -> Floats:
    """Share of the flow through each column's wall facet that belongs to `inlet` (columns,); inlets may meet on a facet.

    By the flows prescribed there; by covered lengths where none is (a port at rest in the lab's frame passes what the frame pumps).
    """
    there = [i for i in case.geometry.inlets if i.side == inlet.side]
    length, lengths = grid.overlap(inlet), sum(grid.overlap(i) for i in there)
    flow, flows = length * inlet.velocity, sum(grid.overlap(i) * i.velocity for i in there)
    by_length = np.divide(length, lengths, out=np.zeros_like(length), where=lengths > 0.0)
    return np.divide(flow, flows, out=by_length, where=flows > 0.0)


def boundary_flows(case: Case, strip: Strip, flow: FaceFlow) -> dict[str, float]:
    """Volume flow through each port, positive into the strip [m2/s, that is m3/s per metre of depth]; collective."""
    grid = strip.grid
    flows = {}
    for inlet in case.geometry.inlets:
        columns = strip.column[strip.wall_cells(inlet.side)]
        flows[inlet.name] = float(flow.inward(inlet.side) @ inlet_share(case, grid, inlet)[columns] * grid.dx)
    for outlet in case.geometry.outlets:
        columns = strip.column[strip.wall_cells(outlet.side)]
        flows[outlet.name] = float(np.sum(flow.inward(outlet.side)[grid.opening(outlet)[columns]]) * grid.dx)
    values = total(strip.comm, list(flows.values()))
    return dict(zip(flows, map(float, values), strict=True))
