"""Every switch of `mpm.case.conventions` against a hand calculation: what it changes, by how much, and that it changes nothing else."""

import math
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case, load_case
from mpm.case.conventions import ADDED, CLOSED_CODE, SWITCHES, switches
from mpm.flow.fields import FaceFlow, FlowField
from mpm.flow.problem import CLOSED_PORTS, FlowProblem
from mpm.flow.steady import steady_flow
from mpm.mesh.strip import BOTTOM, LEFT, TOP, Strip
from mpm.motion.kinematics import REST, StepMotion
from mpm.parallel import largest
from mpm.physics.porous import DiffusionLaw
from mpm.reactor.reactor import Reactor
from mpm.transport.fluxes import FluxAssembler, FluxOperator, cell_diffusivity
from mpm.transport.ports import Ports
from mpm.transport.schemes import Scheme, coefficient_slope, two_point_flux

from .cases import MPI, TINY, column_case, norm, rate, run, strip_case, zone
from .test_fluxes import net_outflow, uniform_flow
from .test_transport_exact import A, danckwerts, middles

COMM = MPI.COMM_WORLD
SCHEMES: tuple[Scheme, ...] = ("fitted", "upwind", "central")
LAWS: tuple[DiffusionLaw, ...] = ("effective", "free", "printed")
D = 2.88e-5
EPS, K, MU, V_S = 0.46, 4.25e-12, 1.72e-5, 0.013


# --- motion.drag_reference ---


def bed(reference: str, head: int = 0, **geometry: Any) -> Case:
    """A strip of powder that moves, alone or with `head` rows of gas above it, 1 cm high."""
    layers = [
        {"name": "bed", "height": "3 mm", "cells": 6 if head else 12, "material": "solid", "moving": True}
    ]
    if head:
        layers.append({"name": "gas", "height": "10 mm", "cells": head})
    solid = {"porosity": EPS, "permeability": f"{K!r} m^2", "surface_to_volume": "0 1/m"}
    return strip_case(
        layers,
        columns=6,
        material={"solid": solid},
        geometry=geometry,
        gas={"viscosity": f"{MU!r} Pa s", "density": "0.7217 kg/m^3"},
    ).with_({"motion.drag_reference": reference, "motion.bed_velocity": f"{V_S} m/s"})


def flow(case: Case, velocity: float, comm: MPI.Comm = MPI.COMM_SELF) -> tuple[FlowProblem, FlowField]:
    """The steady flow while the bed moves at `velocity` [m/s]."""
    problem = FlowProblem(case, Strip(case, comm), 1.0)
    return problem, steady_flow(problem, StepMotion(bed_velocity=velocity))


@pytest.mark.parallel
@pytest.mark.parametrize("velocity", [V_S, -V_S])
def test_a_bed_alone_drags_one_over_porosity_times_more(velocity: float) -> None:
    """Fails when the gas of a strip that powder fills is not carried along at eps v_s, by `superficial` at v_s: 1/eps times as much.

    Seen far from the walls: their layers are sqrt(K) = 2 um thick.
    """
    carried = {}
    for reference, share in (("pore", EPS), ("superficial", 1.0)):
        problem, field = flow(bed(reference), velocity, COMM)
        deep = problem.strip.row[: problem.strip.owned]
        inside = (deep == 5) | (deep == 6)
        gas = field.velocities[LEFT, : problem.strip.owned][inside]
        np.testing.assert_allclose(gas, share * velocity, rtol=1e-8)
        carried[reference] = largest(COMM, [np.abs(gas).max(initial=0.0)])[0]
    assert carried["superficial"] / carried["pore"] == pytest.approx(1.0 / EPS, rel=1e-8)


@pytest.mark.parametrize(("reference", "share"), [("pore", EPS), ("superficial", 1.0)])
def test_a_bed_between_closed_ends_presses_instead(reference: str, share: float) -> None:
    """Fails when a bed that no gas can follow does not raise the pressure by (mu/K) eps v_s a metre, with `superficial` (mu/K) v_s.

    To 0.2 %: at the ends the shear of the solids' flux, which ends there, turns a little gas over.
    """
    problem, field = flow(bed(reference, periodic=False), V_S)
    strip = problem.strip
    rows = field.pressure[np.argsort(strip.cell)].reshape(strip.grid.rows, strip.grid.columns)
    rise = (rows[6, -2] - rows[6, 1]) / ((strip.grid.columns - 3) * strip.grid.dx)
    assert rise == pytest.approx(MU / K * share * V_S, rel=2e-3)
    assert np.abs(field.velocities[LEFT]).max() < 1e-2 * V_S


@pytest.mark.parametrize(("reference", "share"), [("pore", EPS), ("superficial", 1.0)])
def test_gas_at_the_surface_of_a_bed_moves_with_it_by_either(reference: str, share: float) -> None:
    """Fails when the channel above a bed is not Couette's, from v_s at its surface to rest at the roof, with both: only pore gas differs.

    The surface lags by sqrt(K)/H, 2e-4 of v_s, for Brinkman's layer carries the shear.
    """
    problem, field = flow(bed(reference, head=20), V_S)
    strip = problem.strip
    u = field.velocities[LEFT][np.argsort(strip.cell)].reshape(strip.grid.rows, -1)[:, 0]
    np.testing.assert_allclose(u[2:5], share * V_S, rtol=1e-6)
    height, lag = middles(strip.grid.y)[6:], math.sqrt(K)
    exact = V_S * (1e-2 - height) / (1e-2 + lag)
    np.testing.assert_allclose(u[6:], exact, atol=2e-6 * V_S)


def seen_from_a_moving_frame(reference: str, inertia: str) -> float:
    """How much the flow among solids that all move at v differs from that among the same at rest, seen with v, over v; collective.

    Gas seeps upwards at 3 cm/s through a lining, gas, a bed and gas again and is driven along them, so that shear and inertia count.
    """
    porosities = {"lining": 0.5, "bed": EPS}
    layers: list[dict[str, Any]] = [
        {"name": "floor", "height": "2 mm", "cells": 5, "material": "lining"},
        {"name": "plenum", "height": "4 mm", "cells": 6},
        {"name": "bed", "height": "3 mm", "cells": 4, "material": "bed", "moving": True},
        {"name": "headspace", "height": "8 mm", "cells": 9},
        {"name": "roof", "height": "2 mm", "cells": 5, "material": "lining"},
    ]
    port = {"center": "1.5 mm", "width": "3 mm"}
    case = strip_case(
        layers,
        geometry={
            "inlet": [{"name": "in", "velocity": "3 cm/s", **port}],
            "outlet": [{"name": "out", **port}],
        },
        material={
            name: {"porosity": eps, "permeability": "4 um^2", "surface_to_volume": "0 1/m"}
            for name, eps in porosities.items()
        },
    ).with_({"motion.drag_reference": reference, "porous.inertia": inertia})
    for layer in case.geometry.layers:  # a case has one moving layer at most; the equations do not mind
        object.__setattr__(layer, "moving", layer.material_name is not None)
    problem = FlowProblem(case, Strip(case, COMM), 1.0)
    fields = [
        steady_flow(problem, StepMotion(bed_velocity=v, acceleration=-0.05)).velocities for v in (0.0, V_S)
    ]
    strip = problem.strip
    own, grid = slice(0, strip.owned), strip.grid
    share = np.ones(len(layers))
    if reference == "pore":
        share = np.array([porosities.get(l.material_name or "", 1.0) for l in case.geometry.layers])
    seen = fields[1][LEFT, own] - fields[0][LEFT, own] - V_S * share[grid.row_layer][strip.row[own]]
    inside = np.isin(grid.layer_names, ["floor", "roof"], invert=True)[grid.row_layer][strip.row[own]]
    return float(largest(COMM, [np.abs(seen[inside]).max(initial=0.0)])[0] / V_S)


@pytest.mark.parallel
def test_drag_and_inertia_belong_together() -> None:
    """Fails when the flow depends on the frame of the observer with pore and interstitial, or superficial and superficial; or when it does
    not where they are mixed, of which `mpm check` warns: gas that leaves the bed brings (1-eps) v_s of momentum too little or too much."""
    assert seen_from_a_moving_frame("pore", "interstitial") < 1e-8
    assert seen_from_a_moving_frame("superficial", "superficial") < 1e-8
    assert 0.01 < seen_from_a_moving_frame("pore", "superficial") < 0.5
    assert 0.01 < seen_from_a_moving_frame("superficial", "interstitial") < 0.5


# --- transport.scheme ---


def test_coefficients_of_the_schemes_by_hand() -> None:
    """Fails when a - b is not u, a coefficient is negative or not that of its formula, or db/du not its slope; Pe 1e-24 to 1e24."""
    rng = np.random.default_rng(17)
    u = rng.normal(size=3000) * 10.0 ** rng.uniform(-9, 3, 3000)
    g = np.where(rng.random(3000) < 0.1, 0.0, 10.0 ** rng.uniform(-20, 3, 3000))
    for scheme in SCHEMES:
        a, b = two_point_flux(u, g, scheme)
        assert a.min() >= 0.0 and b.min() >= 0.0
        np.testing.assert_allclose(a - b, u, rtol=1e-12, atol=1e-15 * g.max(), err_msg=scheme)
    a, b = two_point_flux(u, g, "upwind")
    for found, downstream in ((a, u), (b, -u)):
        assert np.abs(found - g - np.maximum(downstream, 0.0)).max() <= 1e-15 * (g + np.abs(u)).max()
    a, b = two_point_flux(np.array([1.0, -1.0, 2.0, 2.1, -3.0]), np.ones(5), "central")
    np.testing.assert_allclose(a, [1.5, 0.5, 2.0, 2.1, 0.0])
    np.testing.assert_allclose(b, [0.5, 1.5, 0.0, 0.0, 3.0])
    u, g = np.array([0.3, -0.3, 1.1, -5.0, 7.0]), np.ones(5)
    for scheme in SCHEMES:
        step = 1e-6
        ahead, behind = (two_point_flux(u + s * step, g, scheme)[1] for s in (1.0, -1.0))
        slope = coefficient_slope(u, g, scheme)
        np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), atol=1e-6, err_msg=scheme)


def operator(case: Case, velocity: float, diffusivity: float = D, along: bool = False) -> tuple[Strip, Any]:
    """Fluxes of a strip in which all gas moves at one velocity [m/s], upwards or along."""
    strip = Strip(case, MPI.COMM_SELF)
    flow = uniform_flow(strip, velocity if along else 0.0, 0.0 if along else velocity)
    return strip, FluxAssembler(
        case, strip, cell_diffusivity(strip, diffusivity, law=case.porous.diffusion)
    ).operator(flow)


def between_walls(strip: Strip, op: FluxOperator) -> np.ndarray:
    """Steady concentration row by row where the lowest row is kept at 1 and the highest at 0."""
    n = strip.grid.rows
    faces, up = strip.faces, strip.faces.vertical_flow & (strip.column[strip.faces.behind] == 0)
    low = strip.row[faces.behind[up]]
    a, b = np.empty(n - 1), np.empty(n - 1)
    a[low], b[low] = op.from_behind[up], op.from_ahead[up]
    matrix, rhs = np.eye(n), np.zeros(n)
    rhs[0] = 1.0
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = -a[i - 1], b[i - 1] + a[i], -b[i]
    return np.linalg.solve(matrix, rhs)


@pytest.mark.parametrize("peclet", [0.05, -0.4, 1.5, 1.99, -7.0, 40.0])
def test_steady_profile_in_one_dimension(peclet: float) -> None:
    """Fails when the discrete solution is not that of the scheme by hand: geometric, with exp Pe, 1 + Pe (upwards) and (2+Pe)/(2-Pe) from
    row to row; or when `upwind` is not the exact solution with D + |u| h/2 to second order in Pe, `central` not `fitted` to the same."""
    rows, h = 12, 0.25e-3
    u = peclet * D / h
    ratios = {
        "fitted": math.exp(peclet),
        "upwind": 1.0 + peclet if peclet > 0 else 1.0 / (1.0 - peclet),
        "central": (2.0 + peclet) / (2.0 - peclet) if abs(peclet) < 2.0 else math.inf * (peclet > 0),
    }
    found = {}
    for scheme in SCHEMES:
        case = strip_case([{"name": "gas", "height": f"{rows * h!r} m", "cells": rows}]).with_(
            {"transport.scheme": scheme}
        )
        c = found[scheme] = between_walls(*operator(case, u))
        assert c.min() >= 0.0 and c.max() <= 1.0 + 1e-14
        assert (np.diff(c) <= 1e-14).all()  # nothing that swings
        n, r = np.arange(rows), ratios[scheme]
        exact = (r ** (rows - 1) - r**n) / (r ** (rows - 1) - 1.0) if 0.0 < r < math.inf else None
        if exact is not None:
            np.testing.assert_allclose(c, exact, rtol=1e-9, atol=1e-12)
        else:  # beyond Pe = 2 nothing diffuses
            np.testing.assert_allclose(c[1:-1], 1.0 if peclet > 0 else 0.0, atol=1e-14)
    if abs(peclet) < 1.0:
        more = math.exp(u * h / (D + 0.5 * abs(u) * h))
        spread = (more ** (rows - 1) - more ** np.arange(rows)) / (more ** (rows - 1) - 1.0)
        assert np.abs(found["upwind"] - spread).max() < 0.2 * peclet**2
        assert np.abs(found["central"] - found["fitted"]).max() < 0.2 * peclet**2


@pytest.mark.parametrize("peclet", [0.1, 1.0, -1.9, 5.0])
@pytest.mark.parametrize("along", [True, False])
def test_a_gaussian_spreads_as_the_scheme_says(peclet: float, along: bool) -> None:
    """Fails when the variance of a cloud does not grow by 2 D_eff, D_eff = D (Pe/2) coth(Pe/2), D + |u| h/2, D (or |u| h/2 beyond Pe = 2).

    That is exact for any cloud that is far from walls, whatever its width: the second moment of the discrete fluxes.
    """
    h, n = 0.25e-3, 60
    u = peclet * D / h
    half = 0.5 * abs(u) * h
    expected = {
        "fitted": half / math.tanh(0.5 * abs(peclet)),
        "upwind": D + half,
        "central": D if abs(peclet) <= 2.0 else half,
    }
    for scheme in SCHEMES:
        rows, columns = (2, n) if along else (n, 3)
        case = strip_case(
            [{"name": "gas", "height": f"{rows * h!r} m", "cells": rows}], columns=columns, length=columns * h
        ).with_({"transport.scheme": scheme})
        strip, op = operator(case, u, along=along)
        place = h * (strip.column if along else strip.row)
        c = np.exp(-0.5 * ((place - 0.5 * n * h) / (3.0 * h)) ** 2)
        change = -net_outflow(strip, op, c) / (strip.volume * c.sum())
        mean = (place * c).sum() / c.sum()
        assert (change * place).sum() == pytest.approx(u, rel=1e-9), scheme
        growth = (change * (place - mean) ** 2).sum()
        assert growth == pytest.approx(2.0 * expected[scheme], rel=1e-7), scheme


def reacting(cells: int, scheme: str) -> np.ndarray:
    """C/C_in up a column whose surface takes gas up, S k C, by a whole run to the steady state; Pe of a row is 3.5/cells * 20."""
    material = {
        "porosity": 0.4,
        "permeability": "4 um^2",
        "tortuosity_factor": [7.0, 1.6],
        "surface_to_volume": "4.0 1/m",
        "site_density": "1e4 mol/m^2",
    }
    case = column_case(
        0.02, cells, 0.035, material,
        inlet={"mass_fractions": {"TMA": 2e-4}},
        gas={"diffusivity": "4e-4 m^2/s"},
        transport={"scheme": scheme},
        motion={"gamma": 0.0, "bed_velocity": "0 m/s", "start": "0 s"},
        time={"end": "120 s", "step": "10 s"},
        output={"every": "120 s"},
    )  # fmt: skip
    _, result = run(case)
    return np.asarray(result.field("C_TMA")[:, 0] / case.feed_concentrations({"TMA": 2e-4})["TMA"])


def test_order_of_the_schemes_in_a_whole_run() -> None:
    """Fails when a run with `upwind` is not first order in the row height, with `central` not second, or when what upwinding costs is not
    what |u| h/2 of more diffusion costs, to a tenth of it."""
    diffusivity, sink, u, length, cells = 1e-4, 4.0 * A, 0.035, 0.02, [16, 32, 64]
    exact = danckwerts(u, diffusivity, sink, length)
    for scheme, order in (("upwind", 1.0), ("central", 2.0)):
        errors = []
        for n in cells:
            column, y = reacting(n, scheme), (np.arange(n) + 0.5) * length / n
            errors.append(norm(column - exact(y)))
            if scheme == "upwind" and n > 16:
                spread = danckwerts(u, diffusivity + 0.5 * u * length / n, sink, length)(y)
                assert norm(column - spread) < 0.1 * errors[-1]
        assert rate([1 / n for n in cells], errors) == pytest.approx(order, abs=0.15), (scheme, errors)


def test_no_scheme_leaves_the_bounds() -> None:
    """Fails when the implicit step of any scheme makes less than the least or more than the most of what was there, for flows without
    divergence at Peclet numbers of a cell from 1e-6 to 1e6 and with none, in steps of 1e-3 to 1e5 of what a cell takes to empty."""
    rng = np.random.default_rng(171)
    layers = [
        {"name": "gas", "height": "2 mm", "cells": 4},
        {"name": "felt", "height": "1 mm", "cells": 2, "material": "frit_felt"},
    ]
    for trial in range(60):
        scheme = SCHEMES[trial % 3]
        law = LAWS[trial // 3 % 3]
        case = strip_case(layers, columns=5).with_({"transport.scheme": scheme, "porous.diffusion": law})
        strip = Strip(case, MPI.COMM_SELF)
        flow = uniform_flow(strip, 0.0, 0.0)
        psi = rng.normal(size=(strip.grid.rows + 1, strip.grid.columns))  # of a strip between walls
        psi[0], psi[-1] = 0.0, rng.normal()
        behind, up = strip.faces.behind, strip.faces.vertical_flow
        row, column = strip.row[behind], strip.column[behind]
        right = (column + 1) % strip.grid.columns
        across = (psi[row + 1, right] - psi[row, right]) / strip.height[behind]
        through = (psi[row + 1, column] - psi[row + 1, right]) / strip.grid.dx
        flow.inner[:] = np.where(up, through, across)
        speed = np.abs(flow.inner).max()
        diffusivity = 0.0 if trial % 10 == 9 else speed * 5e-4 * 10.0 ** rng.uniform(-6, 6)
        op = FluxAssembler(case, strip, cell_diffusivity(strip, diffusivity, law=law)).operator(flow)
        n = strip.grid.cells
        matrix = np.stack([net_outflow(strip, op, unit) for unit in np.eye(n)], axis=1)
        np.testing.assert_allclose(matrix.sum(axis=1), 0.0, atol=1e-11 * np.abs(matrix).max())
        dt = 10.0 ** rng.uniform(-3, 5) * strip.gas_volume.min() / np.abs(matrix).max()
        storage = np.diag(strip.gas_volume / dt)
        old = (rng.random(n) < 0.3).astype(float)
        new = np.linalg.solve(storage + matrix, storage @ old)
        assert new.min() > -1e-9 and new.max() < 1.0 + 1e-9, (trial, scheme, new.min(), new.max())


# --- porous.* ---


def test_flux_through_a_frit_of_known_thickness() -> None:
    """Fails when diffusion through gas, frit and gas again is not 1 / (l/D + h/D_eff + l/D), D_eff = eps D/tau^2, D or eps D/tau.

    The centres of the outermost rows are kept at 1 and 0, half a row from the ends.
    """
    eps, factor = 0.37, 2.68
    solid = {"porosity": eps, "tortuosity_factor": [2.85, factor], "permeability": "2.76 um^2", "surface_to_volume": "0 1/m"}  # fmt: skip
    layers = [
        {"name": "below", "height": "1 mm", "cells": 4},
        {"name": "frit", "height": "1.59 mm", "cells": 5, "material": "frit"},
        {"name": "above", "height": "1 mm", "cells": 4},
    ]
    for law, pores in (
        ("effective", eps * D / factor),
        ("free", D),
        ("printed", eps * D / math.sqrt(factor)),
    ):
        case = strip_case(layers, material={"frit": solid}).with_({"porous.diffusion": law})
        strip, op = operator(case, 0.0)
        c = between_walls(strip, op)
        exact = 1.0 / (2 * 0.875e-3 / D + 1.59e-3 / pores)
        lowest = np.flatnonzero(strip.faces.vertical_flow & (strip.row[strip.faces.behind] == 0))[0]
        flux = op.from_behind[lowest] * (c[0] - c[1]) / strip.grid.dx
        assert flux == pytest.approx(exact, rel=1e-12), law


def test_what_pores_leave_of_the_diffusivity_of_the_thesis_reactor() -> None:
    """Fails when free diffusion is not 3.2 times that in the bed and 7.2 (through) to 7.7 times (along) that in the frit, or tau in the
    place of tau^2 not 22 % and 64 to 69 % more; or when gas without pores feels the switch."""
    strip = Strip(zone(mesh=TINY), MPI.COMM_SELF)
    effective, free, printed = (cell_diffusivity(strip, D, law=law) for law in LAWS)
    layer = strip.grid.row_layer[strip.row]
    names = list(strip.grid.layer_names)
    frit, powder = layer == names.index("frit"), layer == names.index("bed")
    np.testing.assert_allclose((free / effective)[:, frit][:, 0], [7.70, 7.24], atol=0.01)
    np.testing.assert_allclose((free / effective)[1, powder], 3.2, atol=0.05)
    np.testing.assert_allclose((printed / effective)[:, frit][:, 0], [1.69, 1.64], atol=0.005)
    np.testing.assert_allclose((printed / effective)[1, powder], 1.22, atol=0.005)
    np.testing.assert_array_equal(free, D)
    np.testing.assert_array_equal(effective[:, ~(frit | powder)], D)
    np.testing.assert_array_equal(printed[:, ~(frit | powder)], D)


PACKING = {"porosity": EPS, "permeability": "4 um^2", "surface_to_volume": "0 1/m"}


@pytest.mark.parametrize(("inertia", "weighs"), [("interstitial", 1.0 / EPS), ("superficial", EPS)])
def test_inertia_of_gas_in_pores(inertia: str, weighs: float) -> None:
    """Fails when starting a plug flow u within dt does not take a pressure drop of (mu/K + rho/(eps dt)) u h, with `superficial`
    (mu/K + eps rho/dt) u h: no wall is felt."""
    dt, u, height = 1e-7, 0.035, 0.02
    case = column_case(height, 10, u, PACKING).with_({"porous.inertia": inertia})
    problem = FlowProblem(case, Strip(case, MPI.COMM_SELF), dt)
    problem.step(REST)
    field, gas = problem.field(), case.gas
    np.testing.assert_allclose(field.velocities[TOP], u, rtol=1e-9)
    column = field.pressure[np.argsort(problem.strip.cell)].reshape(10, -1)[:, 0]
    pressed = (column[0] - column[-1]) * 10 / 9  # between the centres of the outermost rows
    slope = gas.viscosity / 4e-12 + weighs * gas.density / dt
    assert pressed == pytest.approx(slope * u * height, rel=1e-9)


def test_convection_of_gas_in_pores() -> None:
    """Fails when u.grad u does not weigh rho/eps^2 in pores, and rho with `superficial`: that of the same flow of free gas."""
    rng = np.random.default_rng(5)
    forces = {}
    for name, material, inertia in (
        ("gas", {}, "interstitial"),
        ("interstitial", {"material": "packing"}, "interstitial"),
        ("superficial", {"material": "packing"}, "superficial"),
    ):
        layer = {"name": "layer", "height": "3 mm", "cells": 5, **material}
        case = strip_case([layer], columns=6, material={"packing": PACKING}).with_(
            {"porous.inertia": inertia}
        )
        problem = FlowProblem(case, Strip(case, MPI.COMM_SELF), 1.0)
        strip = problem.strip
        if name == "gas":
            u = rng.normal(size=(strip.grid.rows, strip.grid.columns))
            v = rng.normal(size=(strip.grid.rows - 1, strip.grid.columns))
        velocities = np.zeros((4, strip.local))
        velocities[LEFT] = u[strip.row, strip.column]
        velocities[3 - LEFT] = u[strip.row, (strip.column + 1) % strip.grid.columns]
        across = np.vstack([np.zeros(u.shape[1]), v, np.zeros(u.shape[1])])
        velocities[BOTTOM], velocities[TOP] = (
            across[strip.row, strip.column],
            across[strip.row + 1, strip.column],
        )
        problem.start_from(FlowField(velocities, np.zeros(strip.local)), CLOSED_PORTS)
        forces[name] = problem.convective_force().array.copy()
    scale = np.abs(forces["gas"]).max()
    np.testing.assert_allclose(forces["interstitial"], forces["gas"] / EPS**2, atol=1e-12 * scale / EPS**2)
    np.testing.assert_allclose(forces["superficial"], forces["gas"], atol=1e-12 * scale)
    assert scale > 0.0


DECAY = {
    "mechanism": "inline",
    "name": "decay",
    "species": {n: {"elements": {"Q": 1}, "molar_mass": "30 g/mol"} for n in ("A", "B")},
    "site": {"free": {"elements": {"Q": 0}}},
    "reaction": {"decay": {"equation": "A -> B", "A": "5 1/s"}},
}
"""A falls apart in the gas, k = 5 1/s."""


@pytest.mark.parametrize(("volume", "times"), [("gas", 1.0), ("total", 1.0 / EPS)])
def test_batch_reaction_in_pores(volume: str, times: float) -> None:
    """Fails when gas in closed pores does not decay at k, with `total` at k/eps, in ten steps of 1/(1 + k dt) each; or when
    `cvd.rate_mean`, per total volume, is not eps k C and k C."""
    case = column_case(
        3e-3, 3, 0.0, {**PACKING, "site_density": "1e-9 mol/m^2"},
        inlet={"mass_fractions": {"A": 1e-3}, "start": "50 s"},
        chemistry=DECAY, porous={"reaction_volume": volume},
        time={"end": "0.1 s", "step": "10 ms"}, output={"every": "0.1 s"},
    )  # fmt: skip
    reactor = Reactor(case, MPI.COMM_SELF)
    transport = reactor.system.transport
    start = 0.3
    transport.concentration = np.array([[start if n == "A" else 0.0] * 3 for n in transport.names]).repeat(
        3, axis=1
    )
    reactor.system.count_from_here()
    result = reactor.run()
    left = start * (1.0 + 5.0 * times * 0.01) ** -10
    np.testing.assert_allclose(result.field("C_A"), left, rtol=1e-7)
    np.testing.assert_allclose(result.field("C_B"), start - left, rtol=1e-7)
    assert result.summary["cvd"]["rate_mean"] == pytest.approx(EPS * times * 5.0 * left, rel=1e-7)


# --- transport.backflow_rows ---


@pytest.mark.parallel
@pytest.mark.parametrize("side", ["top", "bottom"])
@pytest.mark.parametrize("rows", [1, 2])
def test_what_an_outlet_draws_back_in(rows: int, side: str) -> None:
    """Fails when it is not the mean by volume of the gas in one or two rows of cells of unequal height beside the outlet, all of its
    columns and no others, on any number of ranks."""
    case = strip_case(
        [{"name": "gas", "height": "3 mm", "cells": 6, "grading": 4.0}],
        columns=7, length=7e-3, transport={"backflow_rows": rows},
        geometry={
            "outlet": [
                {"name": "wide", "center": "2.5 mm", "width": "3 mm", "side": side},
                {"name": "other", "center": "6.5 mm", "width": "1 mm", "side": side},
            ]
        },
    )  # fmt: skip
    strip = Strip(case, COMM)
    flow = FaceFlow(
        np.zeros(len(strip.faces.behind)),
        np.full(len(strip.wall_cells("bottom")), 0.01),
        np.full(len(strip.wall_cells("top")), -0.01),
    )
    op = FluxAssembler(case, strip, cell_diffusivity(strip, D)).operator(flow)
    assert op.drawn_in
    everywhere = np.random.default_rng(rows).random((2, strip.grid.rows, strip.grid.columns))
    own = slice(0, strip.owned)
    means = Ports(case, strip, ("TMA", "CH4")).outlet_means(
        [op], everywhere[:, strip.row[own], strip.column[own]]
    )
    heights = strip.grid.dy[:rows] if side == "bottom" else strip.grid.dy[::-1][:rows]
    assert rows == 1 or abs(heights[1] / heights[0] - 1.0) > 0.2  # unequal, so that a plain mean is seen
    near = everywhere[:, :rows] if side == "bottom" else everywhere[:, ::-1][:, :rows]
    for name, columns in (("wide", slice(1, 4)), ("other", slice(6, 7))):
        by_hand = np.einsum("sij,i->s", near[:, :, columns], heights) / (
            heights.sum() * len(range(*columns.indices(7)))
        )
        np.testing.assert_allclose(means[name], by_hand, rtol=1e-12)


def test_two_rows_of_a_strip_that_has_one() -> None:
    """Fails when a strip of a single row or cell cannot be drawn from."""
    port = {"center": "0.5 mm", "width": "1 mm"}
    case = strip_case(
        [{"name": "gas", "height": "1 mm", "cells": 1}],
        columns=1, length=1e-3, conventions="closed-code",
        geometry={"periodic": False, "outlet": [{"name": "out", **port}]},
    )  # fmt: skip
    strip = Strip(case, MPI.COMM_SELF)
    flow = FaceFlow(np.zeros(len(strip.faces.behind)), np.zeros(1), np.full(1, -0.01))
    op = FluxAssembler(case, strip, cell_diffusivity(strip, D)).operator(flow)
    assert Ports(case, strip, ("TMA",)).outlet_means([op], np.array([[0.7]]))["out"] == pytest.approx(0.7)


# --- geometry.inlet_diffusion: tests/test_fluxes.py, by exponential fitting ---


@pytest.mark.parametrize("velocity", ["3.5 cm/s", "35 cm/s", "0 m/s"])
def test_inlet_diffusion_by_the_other_schemes(velocity: str) -> None:
    """Fails when an inlet that diffuses over half a cell, g = 2 D/h, does not feed g + u, or by `central` g + u/2 and u beyond Pe = 2."""
    for scheme in ("upwind", "central"):
        case = zone(
            {
                "geometry.inlet_diffusion": True,
                "transport.scheme": scheme,
                "geometry.inlet.tma.velocity": velocity,
            }
        )
        strip, u = Strip(case, MPI.COMM_SELF), case.geometry.inlets[1].velocity
        flow = uniform_flow(strip, 0.0, 0.0)
        inlet = next(i for i in case.geometry.inlets if i.name == "tma")
        flow.bottom[:] += strip.grid.overlap(inlet)[strip.column[strip.wall_cells("bottom")]] / strip.grid.dx * u  # fmt: skip
        port = FluxAssembler(case, strip, cell_diffusivity(strip, D)).operator(flow).inlets["tma"]
        g = 2.0 * D / strip.grid.dy[0]
        by_hand = g + u if scheme == "upwind" else (g + 0.5 * u if u <= 2.0 * g else u)
        np.testing.assert_allclose(port.into / port.area, by_hand, rtol=1e-12)
        np.testing.assert_allclose((port.into - port.out) / port.area, u, atol=1e-12)


def test_a_case_is_told_by_what_its_switches_are() -> None:
    """Fails when the digest of a case without switches changes with them, does not tell two conventions apart, or takes the name of the
    preset for a difference where all switches stand alike."""
    own = load_case("single_zone")
    typed = {key: value for key, value in switches(own).items() if key != "geometry.inlet_diffusion"}
    assert own.with_(typed).content_hash() == own.content_hash()
    assert typed == ADDED
    others = [own.with_({key: CLOSED_CODE[key]}).content_hash() for key in SWITCHES]
    assert len({own.content_hash(), *others}) == 1 + len(SWITCHES)
    assert own.with_({"conventions": "closed-code"}).content_hash() == own.with_(CLOSED_CODE).content_hash()
