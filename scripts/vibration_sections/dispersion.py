"""How large dispersion by vibration is: closed form, theory of all layers, mpm's cell problem; what numerics add on the thesis' mesh."""

from __future__ import annotations

import numpy as np

from meshes import rows
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion
from mpm.transport.dispersion import vibrational_dispersion
from vibration_sections import theory
from vibration_sections.store import Lab, Numbers, markdown, shown

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

ALL_GAMMAS = (0.3, 0.4, 0.5, 0.6)
THESIS_COLUMN = 0.34e-3  # m
STEPS = 32
"""Of a cycle, by default."""
CELL_WIDTH = 4.66  # mm
"""Columns of the cell problem: vibration's dispersion turns on the rows, which are the thesis' 121."""
CELL = {**rows(26, 10, 18, 67), "time.steps_per_cycle": 128}
STILL = {f"geometry.inlet.{name}.velocity": "1e-6 cm/s" for name in ("tma", "purge")}
BASE = "thesis/single_zone"
PERCENT = 100.0


def watson(lab: Lab, gamma: float) -> dict[str, float]:
    """K/D of plenum and headspace as channels of their own."""
    case = lab.case(BASE, {}, width=CELL_WIDTH, gamma=gamma)
    solid, moved, _ = theory.signals(case)
    height = {layer.name: layer.height for layer in case.geometry.layers}
    floors = {"plenum": moved, "headspace": moved + solid}
    return {
        name: theory.watson(
            floor,
            moved,
            omega=BedMotion(case.motion).vibration.omega,
            viscosity=case.gas.viscosity / case.gas.density,
            diffusivity=case.gas.diffusivity["TMA"],
            height=height[name],
        )
        for name, floor in floors.items()
    }


def in_layers(lab: Lab, gamma: float) -> dict[str, float]:
    """K/D_eff of each layer by the theory of all layers."""
    case = lab.case(BASE, {}, width=CELL_WIDTH, gamma=gamma)
    return theory.stack_dispersion(theory.layers(case), BedMotion(case.motion).vibration.omega)


def cell_problem(lab: Lab, gamma: float, *, still: bool = False) -> Numbers | None:
    """Mean of K_xx of each layer over its D_eff along x, from mpm's cycle problem; `still`: without the gas of the ports."""
    changes = {**CELL, **(STILL if still else {})}
    case = lab.case(BASE, changes, width=CELL_WIDTH, gamma=gamma)

    def make() -> Numbers:
        strip = Strip(case, MPI.COMM_SELF)
        d = case.gas.diffusivity["TMA"]
        k = vibrational_dispersion(case, strip, BedMotion(case.motion), [d])[0, 0]
        found = {}
        for index, layer in enumerate(case.geometry.layers):
            inside = strip.grid.row_layer[strip.row] == index
            m = layer.material
            free = m.porosity * d / m.tortuosity_factor[0] if m else d
            found[layer.name] = float(k[inside] @ strip.volume[inside] / strip.volume[inside].sum() / free)
        return found

    return lab.kept(f"cell problem, Gamma {gamma:g}{', still' * still}", case, make, kind="dispersion")


def table(lab: Lab) -> str:
    """K over D_eff in per cent."""
    lines = []
    for gamma in ALL_GAMMAS:
        alone, whole, cells = watson(lab, gamma), in_layers(lab, gamma), cell_problem(lab, gamma)
        values = [alone["plenum"], alone["headspace"]]
        values += [whole[name] for name in ("plenum", "bed", "headspace")]
        found = [
            None if cells is None else PERCENT * cells[name]
            for name in ("plenum", "frit", "bed", "headspace")
        ]
        shut = cell_problem(lab, gamma, still=True)
        found.append(None if shut is None else PERCENT * shut["bed"])
        lines.append(
            [f"{gamma:g}", *(f"{PERCENT * v:.3f}" for v in values), *(shown(v, ".3f") for v in found)]
        )
    head = ["Gamma", "Watson: plenum", "headspace", "all layers: plenum", "bed", "headspace"]
    return markdown([*head, "mpm: plenum", "frit", "bed", "headspace", "bed, ports shut"], lines)


def added(lab: Lab) -> str:
    """What schemes add to diffusion along x in the thesis' columns, per cent of what there is."""
    lines = []
    for gamma in ALL_GAMMAS:
        case = lab.case(BASE, {}, width=CELL_WIDTH, gamma=gamma)
        ours = {layer.name: layer for layer in theory.layers(case)}
        closed = {layer.name: layer for layer in theory.layers(case, drag="superficial", free=True)}
        for name in ("bed", "headspace"):
            speed = ours[name].velocity()
            shares = [
                theory.added_by_steps(ours[name], BedMotion(case.motion).vibration.period / STEPS),
                theory.added_by_scheme(ours[name], THESIS_COLUMN, "fitted"),
                theory.added_by_scheme(ours[name], THESIS_COLUMN, "upwind"),
                theory.added_by_scheme(closed[name], THESIS_COLUMN, "upwind"),
            ]
            lines.append(
                [
                    f"{gamma:g}",
                    name,
                    f"{100.0 * abs(speed).mean():.2f} ({100.0 * (speed**2).mean() ** 0.5:.2f})",
                    *(f"{PERCENT * share:.2f}" for share in shares),
                    f"{PERCENT * in_layers(lab, gamma)[name]:.2f}",
                ]
            )
    head = ["Gamma", "layer", "mean of abs. u (rms), cm/s", "ours: 32 steps", "ours: fitted", "upwinding"]
    return markdown([*head, "upwinding, closed code's u and D", "vibration itself"], lines)


def swing(lab: Lab) -> str:
    """How far the bed swings about its mean way, and half of that, peak to peak, over the box before the precursor."""
    lines = []
    for gamma in ALL_GAMMAS:
        case = lab.case(BASE, {}, width=CELL_WIDTH, gamma=gamma)
        bed = BedMotion(case.motion)
        times = bed.vibration.period * np.linspace(0.0, 1.0, 2001)
        off = np.array([bed.at(t) - case.motion.mean_velocity * t for t in times])
        box = next(i.center for i in case.geometry.inlets if i.name == "tma")
        lines.append([f"{gamma:g}", f"{1e3 * np.ptp(off):.3f}", f"{0.5 * np.ptp(off) / box:.4f}"])
    return markdown(["Gamma", "swing of the bed, peak to peak, mm", "half of it over the box"], lines)
