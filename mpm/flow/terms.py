"""The terms of the gas's momentum balance (see `mpm.flow.problem`), one function each, as UFL forms.

Every function gives a term of the left-hand side with the unknown `u` (or `p`) and the test function `v` (or `q`), unless it says
otherwise. `u` is superficial; SI units throughout. What is continuous across the face of a solid that moves with v_s, along it too,
is neither u nor u/eps but the total volume flux of gas and solids, U = u + (1-eps) v_s: Darcy's flux u - eps v_s, seen from outside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from ufl import Form, conditional, dot, dS, dx, grad, inner, jump, lt

from mpm.arrays import Floats
from mpm.mesh.strip import Strip
from mpm.numerics.fem import dolfinx

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.materials import Material
    from mpm.flow.state import GasState

Expr = Any  # of UFL, which has no types


@dataclass(frozen=True)
class Medium:
    """The gas and what it flows through, as cell functions: `density` is that of the carrier [SI], `buoyant` what it has more than the
    case's own, whose weight the pressure does not count.

    `porosity` eps, `inertial` what rho times du/dt is multiplied with, `viscosity` mu_e, `resistance_x`, `resistance_y` mu/K [Pa s/m2],
    `moving_solid` 1 - eps in the moving layer and 0 elsewhere, `width` of the cells [m], `half_height` [m]: from a cell's centre to its
    bottom and top as shear feels it (see `shear_distance`).
    """

    density: float | dolfinx.fem.Function
    buoyant: dolfinx.fem.Function | None
    porosity: dolfinx.fem.Function
    viscosity: dolfinx.fem.Function
    resistance_x: dolfinx.fem.Function
    resistance_y: dolfinx.fem.Function
    moving_solid: dolfinx.fem.Function
    width: float
    half_height: dolfinx.fem.Function
    inertial: dolfinx.fem.Function
    superficial_drag: bool

    @classmethod
    def from_case(cls, case: Case, strip: Strip, gas: GasState | None = None) -> Medium:
        """The medium at the viscosity and density of the case, or in the state `gas` of its cells."""
        grid, row = strip.grid, strip.row
        mu = case.gas.viscosity if gas is None else gas.viscosity
        porosity = grid.per_row(lambda solid: solid.porosity, gas=1.0)
        free_path = case.gas.mean_free_path
        along = grid.per_row(lambda solid: solid.slip_permeability(free_path)[0], gas=np.inf)
        through = grid.per_row(lambda solid: solid.slip_permeability(free_path)[1], gas=np.inf)
        brinkman = grid.per_row(lambda solid: brinkman_length(solid, free_path), gas=np.inf)
        cells = {
            "porosity": porosity[row],
            "inertial": (1.0 / porosity if case.porous.inertia == "interstitial" else porosity)[row],
            "viscosity": mu * grid.per_row(lambda solid: solid.viscosity_ratio, gas=1.0)[row],
            "resistance_x": mu / along[row],
            "resistance_y": mu / through[row],
            "moving_solid": np.where(grid.moving, 1.0 - porosity, 0.0)[row],
            "half_height": shear_distance(grid.dy, brinkman)[row],
        }
        functions = {name: strip.cell_values(values, name) for name, values in cells.items()}
        reference = case.motion.drag_reference == "superficial"
        if gas is None:
            return cls(
                density=case.gas.density, buoyant=None, width=grid.dx, superficial_drag=reference, **functions
            )
        density = strip.cell_values(gas.density, "density")
        buoyant = strip.cell_values(gas.buoyant, "buoyant")
        return cls(density=density, buoyant=buoyant, width=grid.dx, superficial_drag=reference, **functions)


def brinkman_length(solid: Material, free_path: float = 0.0) -> float:
    """l = sqrt(K_x mu_e/mu) [m]: how far into a solid the shear of the gas beside it reaches; `free_path` [m] of its molecules."""
    return math.sqrt(solid.slip_permeability(free_path)[0] * solid.viscosity_ratio)


def shear_distance(heights: Floats, brinkman: Floats) -> Floats:
    """Boundary-layer thickness of a row as the shear across its faces feels it [m]: l tanh(height / (2 l)), l the Brinkman length.

    That is half the height in gas, where l is infinite, and l where rows are far higher, as in a powder, whose l is microns: half the row
    would put the no-slip plane at the centre of its outermost row, an error of first order. In between it is exact for one row and keeps
    second order.
    """
    solid = np.isfinite(brinkman)
    length = np.where(solid, brinkman, 1.0)
    return np.where(solid, length * np.tanh(0.5 * heights / length), 0.5 * heights)


def inertia(u: Expr, v: Expr, m: Medium) -> Form:
    """(rho/eps) u . v, to be divided by the time step; eps rho u . v as the thesis prints it (`porous.inertia`, here and in the
    convection)."""
    return (m.density * m.inertial) * inner(u, v) * dx


def along(v: Expr, n: Expr) -> Expr:
    """The part of `v` along a facet with normal `n`."""
    return v - dot(v, n) * n


def viscosity(u: Expr, v: Expr, m: Medium, closed: ufl.Measure) -> Form:
    """-div(mu_e grad u): normal derivatives in the cells, tangential ones as differences between neighbouring cells and to walls.

    For the lowest order these differences are consistent as they stand; a penalty factor would multiply the viscosity. The equation has
    U = u + (1-eps) v_s here: the share of the solids is in `bed_entrainment`.
    """
    n = ufl.FacetNormal(ufl.domain.extract_unique_domain(v))
    half = (0.5 * m.width * n[0] ** 2 + m.half_height * n[1] ** 2) / m.viscosity
    wall_u, wall_v = along(u, n), along(v, n)
    return (
        m.viscosity * inner(grad(u), grad(v)) * dx
        + inner(jump(u), jump(v)) / (half("+") + half("-")) * dS
        + inner(wall_u, wall_v) / half * closed
    )


def drag(u: Expr, v: Expr, m: Medium) -> Form:
    """(mu/K) u, per direction; with `bed_entrainment` relative to a moving solid. The thesis (5-9) has -mu C |u| of the gas alone."""
    return (m.resistance_x * u[0] * v[0] + m.resistance_y * u[1] * v[1]) * dx


def bed_entrainment(solids: Expr, v: Expr, m: Medium, closed: ufl.Measure) -> Form:
    """Right-hand side per unit bed velocity: (mu/K) eps v_s + div(mu_e grad((1-eps) v_s)), with `solids` = (1-eps) along x where v_s is.

    The second part is the shear of the solids' volume flux, which makes U the velocity that is continuous at the face of the bed: the gas
    there moves with v_s, as a wall would move it. With `motion.drag_reference = "superficial"` it is (mu/K) v_s alone: gas that follows the
    bed has u = v_s, which is continuous at its face as it is, and carries 1/eps times the pore gas that goes with the bed.
    """
    if m.superficial_drag:
        return conditional(lt(0.0, m.moving_solid), 1.0, 0.0) * m.resistance_x * v[0] * dx
    moving = conditional(lt(0.0, m.moving_solid), m.porosity, 0.0)
    return moving * m.resistance_x * v[0] * dx - viscosity(solids, v, m, closed)


def frame_acceleration(v: Expr, m: Medium) -> Form:
    """Right-hand side per unit acceleration of the frame along x: -rho a_x. All of rho drives a periodic strip."""
    return -m.density * v[0] * dx


def weight(v: Expr, buoyant: Expr) -> Form:
    """Right-hand side per unit of gravity and upward acceleration of the frame: -(rho - rho_ref) (g + a_y), where density differs."""
    return -buoyant * v[1] * dx
