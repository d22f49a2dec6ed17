"""Flows that are given beforehand, u_p (`mpm.flow.space`): through ports, and out of cells that are heated.

Any field with the right divergence and the right flow through walls serves; what it is like inside the flow equations decide.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.errors import InputError
from mpm.mesh.strip import BOTTOM, LEFT, RIGHT, TOP

if TYPE_CHECKING:
    from mpm.flow.space import FlowSpace

ROUNDING = 1e-12  # of what flows through a wall: inlets that gain no more than this are in balance


def port_fields(space: FlowSpace) -> tuple[Floats, Floats]:
    """Fields u_p (local fluxes,): with the inlets' flows, and per unit vertical velocity of the frame.

    Inlets that stay in the lab's frame see the mesh move past: their velocity relative to it is v - V_y. Raises InputError where such
    inlets have nowhere to pass their gas on.
    """
    inlets, lab = space.case.geometry.inlets, space.case.motion.inlet_frame == "lab"
    density = [space.case.inlet_density(inlet) for inlet in inlets]
    upwards = [
        d * (i.velocity if i.side == "bottom" else -i.velocity) for i, d in zip(inlets, density, strict=True)
    ]
    return _through(space, upwards), _through(space, [-d if lab else 0.0 for d in density])


def _through(space: FlowSpace, upwards: list[float]) -> Floats:
    """A field without divergence for these upward velocities in the inlets [m/s]; outlets share what must leave.

    Between the walls u_y changes linearly; u_x, the same in all rows, carries what this leaves.
    """
    grid, geometry = space.strip.grid, space.case.geometry
    wall = {side: np.zeros(grid.columns) for side in ("bottom", "top")}  # upward velocities
    for inlet, velocity in zip(geometry.inlets, upwards, strict=True):
        wall[inlet.side] += grid.overlap(inlet) / grid.dx * velocity
    gained = wall["bottom"].sum() - wall["top"].sum()
    open_columns = [(o.side, grid.opening(o)) for o in geometry.outlets]
    count = sum(int(opening.sum()) for _, opening in open_columns)
    if not count and abs(gained) > ROUNDING * np.abs(wall["bottom"]).sum():
        raise InputError(
            "motion.inlet_frame: found inlets that stay in the lab's frame, and no outlet for what the moving reactor takes in; "
            "accepted: at least one outlet"
        )
    for side, opening in open_columns:
        wall[side][opening] += (1.0 if side == "top" else -1.0) * gained / count
    level = (grid.y - grid.y[0]) / grid.height
    along = np.concatenate([[0.0], np.cumsum((wall["bottom"] - wall["top"]) * grid.dx / grid.height)])
    strip = space.strip
    row, column = strip.row, strip.column
    field = np.zeros(len(space.weights))
    for facet, at in ((BOTTOM, level[row]), (TOP, level[row + 1])):
        upward = (1.0 - at) * wall["bottom"][column] + at * wall["top"][column]
        field[space.dofs[:, facet]] = upward
    field[space.dofs[:, LEFT]], field[space.dofs[:, RIGHT]] = along[column], along[column + 1]
    if grid.periodic:
        field[space.dofs[column == grid.columns - 1, RIGHT]] = 0.0
    return field * space.weights


def spreading(space: FlowSpace, source: Floats) -> Floats:
    """A field (local fluxes,) whose divergence integrated over own cells is `source` (own,) [m2/s], nothing through inlets; collective.

    Outlets share what must leave. Gas layers carry it along the strip, evenly over their height: through powder it would take forces
    that must cancel later.
    """
    strip, grid = space.strip, space.strip.grid
    gained = strip.scatter.to_all(source).reshape(grid.rows, grid.columns)
    leaving = {side: np.zeros(grid.columns) for side in ("bottom", "top")}
    open_columns = [(o.side, grid.opening(o)) for o in space.case.geometry.outlets]
    count = sum(int(opening.sum()) for _, opening in open_columns)
    for side, opening in open_columns:
        leaving[side][opening] += gained.sum() / count
    left = gained.sum(axis=0) - leaving["bottom"] - leaving["top"]  # in each column, for its neighbours
    gas = grid.per_row(lambda _: 0.0, gas=1.0)
    share = grid.dy * (gas if gas.any() else 1.0)
    share /= share.sum()
    along = np.concatenate([[0.0], np.cumsum(left)]) * (share / grid.dy)[:, None]  # velocities
    along[:, -1] = 0.0
    upwards = np.vstack([-leaving["bottom"], gained - left * share[:, None]]).cumsum(axis=0) / grid.dx
    # nothing through inlets, not even rounding: it would be what a closed one feeds
    upwards[-1] = leaving["top"] / grid.dx
    row, column = strip.row, strip.column
    field = np.zeros(len(space.weights))
    field[space.dofs[:, BOTTOM]], field[space.dofs[:, TOP]] = upwards[row, column], upwards[row + 1, column]
    field[space.dofs[:, LEFT]], field[space.dofs[:, RIGHT]] = along[row, column], along[row, column + 1]
    return field * space.weights
