"""Figure 5.8: streamlines before and during vibration in both frames, and a vibration cycle in the lab's frame as an animation."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from mpm.case.case import Case
from mpm.mesh.grid import Grid
from mpm.motion.kinematics import BedMotion
from mpm.pictures.outline import draw_ports
from mpm.pictures.standard import STYLE
from reproduction.flow_rows import GAMMAS, resolved
from reproduction.flows import BOTTOM, LEFT, RIGHT, TOP, at_rest, cycle
from reproduction.pictures import save
from reproduction.store import Arrays, Lab

Floats = NDArray[np.float64]
MM = 1e3
DPI = 80
SHOWN_PHASES = (0.0, 90.0, 180.0, 270.0)
LINE_Y = -0.005
"""The thesis draws streamlines through this line, right below the frit [m]."""


def pore_velocity(grid: Grid, case: Case, field: Floats) -> tuple[Floats, Floats]:
    """Velocity of the gas in the pores at cell centres relative to the reactor, (rows, columns) each [m/s]."""
    eps = grid.per_row(lambda solid: solid.porosity, gas=1.0)[:, None]
    return 0.5 * (field[LEFT] + field[RIGHT]) / eps, 0.5 * (field[BOTTOM] + field[TOP]) / eps


def stream_panel(panel: Axes, case: Case, field: Floats, frame: tuple[float, float], title: str) -> None:
    """Streamlines of one instant through a line below the frit, with the reactor moving at `frame` [m/s] (0, 0: in its own frame)."""
    grid = Grid.from_case(case)
    u, v = pore_velocity(grid, case, field)
    x, y = 0.5 * (grid.x[1:] + grid.x[:-1]), 0.5 * (grid.y[1:] + grid.y[:-1])
    even = np.linspace(y[0], y[-1], 220)
    u, v = (
        np.array([np.interp(even, y, w[:, j]) for j in range(grid.columns)]).T
        for w in (u + frame[0], v + frame[1])
    )
    seeds = np.column_stack([np.linspace(0.03, 0.97, 32) * grid.length, np.full(32, LINE_Y)])
    lines = panel.streamplot(
        x * MM, even * MM, u * MM, v * MM, start_points=seeds * MM, density=6, linewidth=0.6, arrowsize=0.6,
        color=np.hypot(u, v) * 1e2, cmap="viridis_r", broken_streamlines=False,
    )  # fmt: skip
    lines.lines.set_clim(0.0, 6.0)
    for name in grid.layer_names[:-1]:
        panel.axhline(grid.y[grid.layer_rows(name).stop] * MM, color="#999999", linewidth=0.5)
    draw_ports(panel, case)
    panel.set(xlim=(0.0, grid.length * MM), ylim=(grid.y[0] * MM, grid.y[-1] * MM), ylabel="y [mm]")
    panel.set_title(title, fontsize=8, pad=17)


def at_phase(arrays: Arrays, phase: float) -> int:
    """Index into `shown` of the stored step nearest to a phase [deg]."""
    phases = arrays["phase"][arrays["shown"]]
    return int(np.argmin(np.abs((phases - phase + 180.0) % 360.0 - 180.0)))


def streams(gamma: float) -> Callable[[Lab], Figure]:
    """A figure of streamlines at four phases in both frames; with the flow before the vibration on top."""

    def make(lab: Lab) -> Figure:
        case = resolved(lab, gamma=gamma, startup="developed")
        arrays = cycle(lab, case)
        figure = Figure(figsize=(10.5, 9.6), layout="constrained")
        axes = figure.subplots(5, 2, sharex=True)
        before = resolved(lab, mesh="thesis")
        stream_panel(
            axes[0, 0], before, at_rest(lab, before)["after_50ms"], (0.0, 0.0), "before the vibration"
        )
        axes[0, 1].set_axis_off()
        for row, phase in zip(axes[1:], SHOWN_PHASES, strict=True):
            k = at_phase(arrays, phase)
            step = int(arrays["shown"][k])
            frame = (float(arrays["frame"][step, 0]), float(arrays["frame"][step, 1]))
            text = f"phase {arrays['phase'][step]:.0f} deg, V = ({frame[0] * 1e2:.1f}, {frame[1] * 1e2:.1f}) cm/s"
            stream_panel(row[0], case, arrays["fields"][k].astype(float), frame, f"lab's frame, {text}")
            stream_panel(
                row[1], case, arrays["fields"][k].astype(float), (0.0, 0.0), f"reactor's frame, {text}"
            )
        for panel in axes[-1]:
            panel.set_xlabel("x [mm]", labelpad=13)
        return figure

    return make


def animation(lab: Lab, path: Path) -> None:
    """One vibration cycle in the lab's frame around the top of the bed: the mesh moves, colours are u_x of the gas, arrows its velocity."""
    case = resolved(lab, gamma=0.6, startup="developed")
    arrays, grid, bed = cycle(lab, case), Grid.from_case(case), BedMotion(case.motion)
    window_x, window_y = (0.100, 0.108), (-0.0052, 0.0035)
    columns = np.flatnonzero(
        (grid.x[:-1] > window_x[0] - 2 * grid.dx) & (grid.x[1:] < window_x[1] + 2 * grid.dx)
    )
    rows = np.flatnonzero((grid.y[:-1] > window_y[0] - 1e-3) & (grid.y[1:] < window_y[1] + 2e-3))
    x = grid.x[columns[0] : columns[-1] + 2]
    y = grid.y[rows[0] : rows[-1] + 2]
    moving = grid.layer_rows("bed")
    dt = 1.0 / (case.motion.frequency * case.time.steps_per_cycle)
    frames = []
    for k, step in enumerate(arrays["shown"]):
        t = bed.vibration.period + (int(step) + 0.5) * dt
        dx, dy = bed.vibration.displacement(t)
        slide = bed.at(t) - bed.at(bed.vibration.period)
        u, v = pore_velocity(grid, case, arrays["fields"][k].astype(float))
        u = (u + arrays["frame"][step, 0])[np.ix_(rows, columns)] * 1e2
        v = (v + arrays["frame"][step, 1])[np.ix_(rows, columns)] * 1e2
        figure = Figure(figsize=(4.6, 4.3), layout="constrained")
        panel = figure.subplots()
        mesh = panel.pcolormesh((x + dx) * MM, (y + dy) * MM, u, cmap="PuOr_r", vmin=-5.0, vmax=5.0)
        edges = np.stack([x, x], axis=1) + dx
        for row in rows:
            shift = slide if moving.start <= row < moving.stop else 0.0
            ends = np.broadcast_to(np.array([grid.y[row], grid.y[row + 1]]) + dy, edges.shape)
            panel.add_collection(
                LineCollection(
                    list(np.stack([edges + shift, ends], axis=2) * MM), colors="#555555", linewidths=0.4
                )
            )
        panel.hlines((y + dy) * MM, (x[0] + dx) * MM, (x[-1] + dx) * MM, colors="#555555", linewidths=0.4)
        centre_x, centre_y = 0.5 * (x[1:] + x[:-1]) + dx, 0.5 * (y[1:] + y[:-1]) + dy
        panel.quiver(centre_x * MM, centre_y[::2] * MM, u[::2], v[::2], scale=90.0, width=0.004)
        panel.axhline(0.0, color="#D55E00", linewidth=0.8, linestyle=":")
        panel.set(
            xlim=np.array(window_x) * MM,
            ylim=np.array(window_y) * MM,
            xlabel="x [mm], lab",
            ylabel="y [mm], lab",
            aspect="equal",
        )
        panel.set_title(f"Gamma 0.60, phase {arrays['phase'][step]:.0f} deg", fontsize=9)
        figure.colorbar(mesh, ax=panel, label="u$_x$ of the gas in the lab's frame [cm/s]")
        canvas = FigureCanvasAgg(figure)
        figure.set_dpi(DPI)
        canvas.draw()
        frames.append(
            Image.fromarray(np.asarray(canvas.buffer_rgba())).convert(
                "P", palette=Image.Palette.ADAPTIVE, colors=32
            )
        )
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=160, loop=0, optimize=True)


STREAMS: dict[str, tuple[Callable[[Lab], Figure] | None, str]] = {
    f"figure_5_8_gamma_{round(100 * gamma):03d}": (
        streams(gamma),
        f"Figure 5.8: streamlines through a line below the frit at Gamma {gamma:.2f}, developed state, in "
        "the lab's and in the reactor's frame.",
    )
    for gamma in GAMMAS
}
STREAMS["vibration_cycle"] = (
    None,
    "A vibration cycle in the lab's frame around the top of the bed, Gamma 0.60; the mesh moves with the "
    "reactor, the bed's columns with the powder, to scale.",
)


def draw_streams(lab: Lab, folder: Path) -> None:
    """Draw the streamlines and the animation."""
    folder.mkdir(parents=True, exist_ok=True)
    with style.context(STYLE), suppress(FileNotFoundError):  # the rows have not been measured
        for name, (make, _) in STREAMS.items():
            if make is not None:
                save(make(lab), folder / f"{name}.png", DPI)
        animation(lab, folder / "vibration_cycle.gif")
