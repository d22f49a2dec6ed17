"""Pictures of the rows that correspond to figures 5.9 to 5.15 of the thesis, from the stored runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from mpm.output.results import Run
from mpm.pictures.outline import OKABE_ITO, draw_ports, draw_zones, formula
from mpm.pictures.standard import STYLE
from reproduction import cycle_rows, outlet_rows, vibration_rows, zone_rows
from reproduction.store import Lab

Floats = NDArray[np.float64]
MM = 1e3
DPI = 90
SITE = "OAl(CH3)2"


def strip_map(
    panel: Axes, run: Run, values: Floats, norm: Normalize, colours: str, title: str, layer: str | None = None
) -> QuadMesh:
    """A field of the strip, or of one layer, stretched in height."""
    grid = run.grid
    rows = grid.layer_rows(layer) if layer else slice(0, grid.rows)
    y = grid.y[rows.start : rows.stop + 1] * MM
    mesh = panel.pcolormesh(grid.x * MM, y, values[rows], norm=norm, cmap=colours, rasterized=True)
    if layer is None:
        for name in grid.layer_names[:-1]:
            panel.axhline(grid.y[grid.layer_rows(name).stop] * MM, color="black", linewidth=0.5)
        draw_ports(panel, run.case)
    draw_zones(panel, run.case)
    panel.set_title(title, fontsize=9, pad=18 if layer is None else 6)
    panel.set_ylabel("y [mm]")
    return mesh


def concentrations(lab: Lab) -> Figure:
    """Figure 5.9: TMA at t = 1.925 s."""
    impulsive = {"fidelity": "resolved", "motion.startup": "impulsive"}
    early = vibration_rows.EARLY
    cases = [
        (
            f"Gamma {g:.2f}, 1.3 cm/s",
            {
                **impulsive,
                "time.steps_per_cycle": 16,
                "motion.inlet_frame": "reactor",
                "motion.gamma": g,
                **early,
            },
        )
        for g in (0.3, 0.6)
    ]
    cases += [
        (
            f"Gamma 0.30, {speed}",
            {**early, **impulsive, "time.steps_per_cycle": 16, "motion.bed_velocity": speed},
        )
        for speed in ("0.5 cm/s", "3.0 cm/s")
    ]
    figure = Figure(figsize=(10.0, 5.4), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for panel, (title, changes) in zip(axes.flat, cases, strict=True):
        run = lab.run(lab.case("zone", "light", changes))
        share = run.field(run.snapshot(), "C_TMA") / zone_rows.feed(run.case)
        mesh = strip_map(panel, run, np.maximum(share, 1e-4), LogNorm(1e-4, 1.0), "viridis", title)
        x, y = 0.5 * (run.grid.x[1:] + run.grid.x[:-1]), 0.5 * (run.grid.y[1:] + run.grid.y[:-1])
        panel.contour(x * MM, y * MM, share, levels=[0.1, 0.5], colors=["white", "black"], linewidths=0.8)
    for panel in axes[-1]:
        panel.set_xlabel("x [mm]", labelpad=14)
    figure.colorbar(mesh, ax=axes, label="TMA over its feed (white: 0.1, black: 0.5)")
    return figure


def box_means(lab: Lab) -> Figure:
    """Figure 5.10b: box mean of the coverage by Gamma (start-up) and by bed speed."""
    figure = Figure(figsize=(8.4, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for gamma in vibration_rows.GAMMAS:
        run = lab.run(vibration_rows.pulse_case(lab, "coarse", "impulsive", "reactor", gamma))
        left.plot(run.history["time"], run.history["titration.tma.box_mean"], label=f"Gamma {gamma:.1f}")
    for speed in vibration_rows.SPEEDS:
        run = lab.run(lab.case("zone", "light", {"motion.bed_velocity": speed}))
        right.plot(run.history["time"], run.history["titration.tma.box_mean"], label=speed)
    for panel, title in ((left, "start-up transient, 1.3 cm/s"), (right, "cycle mean, Gamma 0.30")):
        panel.set(xlabel="time [s]", ylabel=f"box mean of {formula(SITE)}", title=title)
        panel.legend()
        panel.grid(alpha=0.25)
    return figure


def titration_by_dose(lab: Lab) -> Figure:
    """Figure 5.11: coverage in the bed at t = 20 s for four doses."""
    figure = Figure(figsize=(9.0, 5.6), layout="constrained")
    axes = figure.subplots(len(zone_rows.DOSES), 1, sharex=True)
    for panel, dose in zip(axes, zone_rows.DOSES, strict=True):
        run = lab.run(zone_rows.dose_case(lab, dose))
        theta = run.field(run.snapshot(), f"theta_{SITE}")
        title = f"Y = {dose:g}, excess number {zone_rows.excess(run.case):.2f}"
        mesh = strip_map(panel, run, theta, Normalize(0.0, 1.0), "cividis", title, "bed")
        panel.axvline(
            next(i.center for i in run.case.geometry.inlets if i.name == "tma") * MM,
            color="black",
            lw=0.8,
            ls=":",
        )
    axes[-1].set_xlabel("x [mm] (the bed moves to the right; dotted: centreline of the TMA inlet)")
    figure.colorbar(mesh, ax=axes, label=f"coverage of {formula(SITE)}")
    return figure


def outlet_by_dose(lab: Lab) -> Figure:
    """Figure 5.12: box mean and outlet CH4 for four doses."""
    figure = Figure(figsize=(8.4, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for dose in zone_rows.DOSES:
        run = lab.run(zone_rows.dose_case(lab, dose))
        left.plot(run.history["time"], run.history["titration.tma.box_mean"], label=f"Y {dose:g}")
        time, x = outlet_rows.signal(run, outlet_rows.METHANE)
        right.semilogy(time, np.where(x > 0.0, x, np.nan), label=f"Y {dose:g}")
    for knee in outlet_rows.KNEES:
        right.axvline(knee, color="#777777", lw=0.8, ls=":")
    left.set(xlabel="time [s]", ylabel=f"box mean of {formula(SITE)}")
    right.set(xlabel="time [s]", ylabel=f"outlet mole fraction of {formula('CH4')}", ylim=(1e-7, None))
    left.legend()
    for panel in (left, right):
        panel.grid(alpha=0.25)
    return figure


def both_zones(lab: Lab) -> Figure:
    """Figure 5.13: box means and outlet CH4 of the two zones, two port widths."""
    figure = Figure(figsize=(8.4, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for width, line in zip(cycle_rows.WIDTHS, ("-", "--"), strict=True):
        run = lab.run(cycle_rows.cycle_case(lab, width))
        time = run.history["time"]
        for n, (inlet, zone) in enumerate((("tma", "zone1"), ("water", "zone2"))):
            text = f"zone {n + 1}, ports {width}"
            left.plot(time, run.history[f"titration.{inlet}.box_mean"], line, color=OKABE_ITO[n], label=text)
            right.plot(time, run.history[f"outlets.{zone}.x.CH4"] * 1e6, line, color=OKABE_ITO[n], label=text)
    left.set(xlabel="time [s]", ylabel="box mean of what the inlet makes")
    right.set(xlabel="time [s]", ylabel=f"outlet {formula('CH4')} [ppm]")
    left.legend(fontsize=7)
    for panel in (left, right):
        panel.grid(alpha=0.25)
    return figure


def cycle_maps(lab: Lab) -> Figure:
    """Figure 5.14: coverage of the bed and CVD rate at t = 60.4 s, two port widths."""
    figure = Figure(figsize=(10.0, 6.6), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True, height_ratios=(1, 1.6, 1, 1.6))
    for width, theta_panel, cvd_panel in zip(cycle_rows.WIDTHS, axes[::2], axes[1::2], strict=True):
        run = lab.run(cycle_rows.cycle_case(lab, width))
        shot = run.snapshot()
        theta = strip_map(
            theta_panel,
            run,
            run.field(shot, f"theta_{SITE}"),
            Normalize(0.0, 1.0),
            "cividis",
            f"bed, ports {width}",
            "bed",
        )
        rate = np.maximum(run.field(shot, "cvd_rate"), 1e-20)
        top = float(rate.max())
        cvd = strip_map(cvd_panel, run, rate, LogNorm(1e-4 * top, top), "viridis", f"CVD, ports {width}")
        figure.colorbar(theta, ax=theta_panel, label=formula(SITE), aspect=8)
        figure.colorbar(cvd, ax=cvd_panel, label="mol m$^{-3}$ s$^{-1}$", aspect=12)
    axes[-1].set_xlabel("x [mm]", labelpad=14)
    return figure


def cvd_histories(lab: Lab) -> Figure:
    """Figure 5.15: mean CVD rate and coverage of OH in zone 2, with and without delay."""
    figure = Figure(figsize=(8.4, 5.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    for (left, right), width in zip(axes, cycle_rows.WIDTHS, strict=True):
        for text, changes in (
            ("Y 1e-3/1e-3", cycle_rows.RICH),
            ("2e-4/7.5e-5", {}),
            ("2e-4/7.5e-5, 15 s delay", cycle_rows.DELAY),
        ):
            run = lab.run(cycle_rows.cycle_case(lab, width, changes))
            rate = run.history["cvd.rate_mean"]
            left.semilogy(run.history["time"], np.where(rate > 0.0, rate, np.nan), label=text)
            right.plot(run.history["time"], run.history["titration.water.box_mean"], label=text)
        left.set(ylabel="mean CVD rate [mol m$^{-3}$ s$^{-1}$]", title=f"ports {width}", ylim=(1e-16, None))
        right.set(ylabel="box mean of OH, zone 2")
        left.grid(alpha=0.25)
        right.grid(alpha=0.25)
    axes[0, 1].legend(fontsize=7)
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    return figure


def front_histories(lab: Lab) -> Figure:
    """Where the fronts lie over time: one zone by dose, and both zones of the cycle."""
    figure = Figure(figsize=(8.4, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)

    def plot(panel: Axes, run: Run, inlet: str, every: int, line: str, text: str, colour: str) -> None:
        steps = range(0, len(run.times), every)
        places = [zone_rows.bed_front(run, inlet, k) for k in steps]
        shown = [np.nan if place is None else place * MM for place in places]
        panel.plot([run.times[k] for k in steps], shown, line, label=text, color=colour)

    for n, dose in enumerate(zone_rows.DOSES):
        plot(left, lab.run(zone_rows.dose_case(lab, dose)), "tma", 2, "-", f"Y {dose:g}", OKABE_ITO[n])
    for width, line in zip(cycle_rows.WIDTHS, ("-", "--"), strict=True):
        run = lab.run(cycle_rows.cycle_case(lab, width))
        for n, inlet in enumerate(("tma", "water")):
            plot(right, run, inlet, 4, line, f"{inlet}, ports {width}", OKABE_ITO[n])
    left.set(xlabel="time [s]", ylabel="front in the bed, upstream of its inlet [mm]", title="one zone")
    right.set(xlabel="time [s]", title="full cycle, Y 2e-4/7.5e-5")
    for panel in (left, right):
        panel.legend(fontsize=7)
        panel.grid(alpha=0.25)
    return figure


def dose_map(lab: Lab) -> Figure:
    """The map of row R22: CVD rate by both dose ratios."""
    figure = Figure(figsize=(8.6, 3.6), layout="constrained")
    axes = figure.subplots(1, 2)
    for panel, width in zip(axes, cycle_rows.WIDTHS, strict=True):
        found = lab.kept("R22")["numbers"][width]
        ratios, rate = found["ratios"], np.array(found["rate"])
        image = panel.imshow(rate.T, origin="lower", norm=LogNorm(), cmap="viridis")
        panel.set_xticks(range(len(ratios)), [f"{r:g}" for r in ratios])
        panel.set_yticks(range(len(ratios)), [f"{r:g}" for r in ratios])
        panel.set(xlabel="TMA over saturation", ylabel="water over saturation", title=f"ports {width}")
        figure.colorbar(image, ax=panel, label="mean CVD rate [mol m$^{-3}$ s$^{-1}$]")
    return figure


PICTURES: dict[str, tuple[Callable[[Lab], Figure], str]] = {
    "figure_5_9": (
        concentrations,
        "Figure 5.9: TMA at t = 1.925 s in the start-up transient, inlets fixed to the reactor.",
    ),
    "figure_5_10": (box_means, "Figure 5.10b: box mean of the coverage by Gamma and by bed speed, Y 1e-3."),
    "figure_5_11": (titration_by_dose, "Figure 5.11: coverage in the bed at t = 20 s."),
    "figure_5_12": (
        outlet_by_dose,
        "Figure 5.12: box mean and outlet methane; dotted: the knees of the thesis.",
    ),
    "figure_5_13": (both_zones, "Figure 5.13: box means and outlet methane of both zones, Y 2e-4/7.5e-5."),
    "figure_5_14": (
        cycle_maps,
        "Figure 5.14: coverage in the bed and CVD rate at t = 60.4 s, Y 2e-4/7.5e-5.",
    ),
    "figure_5_15": (cvd_histories, "Figure 5.15: mean CVD rate and coverage of OH in zone 2."),
    "fronts": (
        front_histories,
        "Where the fronts lie over time: distance upstream of the inlet at which the coverage is 1/2.",
    ),
    "cvd_map": (dose_map, "Row R22: mean CVD rate over both dose ratios."),
}


def save(figure: Figure, path: Path, dpi: int = DPI) -> None:
    """Save a figure with a palette of 96 colours: a third of the size, and no difference to see."""
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB").quantize(96).save(path, optimize=True)


def draw(lab: Lab, folder: Path) -> list[str]:
    """Draw every picture whose runs are there; returns the names of those drawn."""
    drawn = []
    folder.mkdir(parents=True, exist_ok=True)
    with style.context(STYLE):
        for name, (make, _) in PICTURES.items():
            try:
                figure = make(lab)
            except FileNotFoundError:  # the row has not been measured
                continue
            save(figure, folder / f"{name}.png")
            drawn.append(name)
    return drawn
