"""Files and pictures of a finished DEM run: profile.csv, summary.json, tables of the maps, plots."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mpm.arrays import Floats
from mpm.errors import printable
from mpm.files import write_atomically, write_picture
from mpm.labels import literal
from mpm.plain import json_text

from .analysis import Results
from .case import DemCase
from .profile import conditions, scaled_to_mean
from .spec import BoxSpec, Particles
from .waveform import Waveform

BASE, BED, FIT = "#0072B2", "#D55E00", "#009E73"  # Okabe and Ito: stay apart for colour-blind readers


def write_summary(directory: Path, summary: Mapping[str, Any]) -> None:
    """summary.json: SI, finite numbers only; what could not be computed is absent."""
    write_atomically(directory / "summary.json", json_text(summary, "summary.json"))


def write_tables(directory: Path, case: DemCase, results: Results, waveform: Waveform) -> None:
    """profile.csv, its fit, the scaled profile when asked, voidage.csv, depth.csv, residence_times.csv."""
    mean = case.profile.mean_velocity
    about = (
        f"{printable(case.title)}: DEM, seeds {', '.join(map(str, case.run.seeds))}, {waveform.frequency:g} Hz",
        conditions(waveform, case.waveform.kind).line(),
    )
    results.curve.write(
        directory / "profile.csv",
        [
            *about,
            f"cycle mean of u_x {results.curve.mean:.6g} m/s; phase 0: reactor at mean position, moving up",
        ],
    )
    fit = results.fit
    results.fit.profile.write(
        directory / "profile_fit.csv",
        [
            *about,
            f"piecewise fit: base velocity in contact, flight at u_x = {fit.flight[0]:.6g} m/s from "
            f"{fit.liftoff:.2f} to {fit.contact:.2f} deg; rms difference to profile.csv {fit.rms:.3g} m/s",
        ],
    )
    if mean is not None:
        scaled = scaled_to_mean(fit, results.curve, results.base, mean)
        scaled.profile.write(
            directory / "profile_scaled.csv",
            [
                *about,
                f"SCALED: phases of profile_fit.csv, flight velocity changed from {fit.flight[0]:.6g} to "
                f"{scaled.flight[0]:.6g} m/s so that the cycle mean is the prescribed {mean:.6g} m/s",
            ],
        )
    d = case.build_powder().diameter
    heights = results.heights
    columns = ",".join(f"{phase:.5g}" for phase in results.curve.phase)
    table = np.column_stack([heights, 1.0 - results.solid.T])
    _csv(directory / "voidage.csv", f"height_m \\ phase_deg,{columns}", table)
    filled = results.solid.mean(axis=0) > 0.02
    _csv(
        directory / "depth.csv",
        "height_m,height_d,u_x_m/s,voidage",
        np.column_stack(
            [heights, heights / d, results.layer_velocity, 1.0 - results.solid.mean(axis=0)]
        )[filled],
    )  # fmt: skip
    times = np.sort(results.residence[np.isfinite(results.residence)])
    share = np.arange(1, len(times) + 1) / len(results.residence)
    _csv(directory / "residence_times.csv", "time_s,share_of_particles", np.column_stack([times, share]))


def _csv(path: Path, header: str, rows: Floats) -> None:
    lines = [header, *(",".join(f"{value:.6g}" for value in row) for row in rows)]
    write_atomically(path, "\n".join(lines) + "\n")


def draw(
    directory: Path, case: DemCase, results: Results, scene: tuple[BoxSpec, Particles] | None
) -> list[Path]:
    """All pictures into directory/plots."""
    plots = directory / "plots"
    plots.mkdir(exist_ok=True)
    figures = {
        "velocity": _velocity(case, results),
        "voidage": _voidage(case, results),
        "depth": _depth(case, results),
        "residence": _residence(case, results),
    }
    if scene is not None:
        figures["bed"] = _bed(*scene)
        figures["bed"].suptitle(literal(case.title), fontsize=10)
    paths = []
    for name, figure in figures.items():
        path = plots / f"{name}.png"
        write_picture(path, figure, dpi=150)
        paths.append(path)
    return paths


def _velocity(case: DemCase, results: Results) -> Figure:
    """Bed against base over the cycle, the fit, contact, gap and coordination."""
    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2))
    phase = results.curve.phase
    for axis, k, name in ((upper, 0, "along, $u_x$"), (middle, 1, "vertical, $u_y$")):
        axis.plot(phase, 100 * results.base[k], color=BASE, label="base")
        axis.plot(phase, 100 * results.curve.velocity[k], color=BED, label="bed (DEM)")
        axis.plot(phase, 100 * results.fit.profile.velocity[k], color=FIT, ls="--", label="piecewise fit")
        axis.set_ylabel(f"velocity {name} [cm/s]")
        axis.fill_between(
            phase,
            0,
            1,
            where=results.curve.contact < 0.5,
            transform=axis.get_xaxis_transform(),
            color="0.92",
            zorder=0,
        )
        axis.axhline(0, color="0.6", lw=0.6)
    upper.axhline(100 * results.seed_velocities.mean(), color=BED, lw=0.8, ls=":", label="cycle mean")
    upper.legend(loc="upper right", frameon=False)
    upper.set_title(f"{literal(case.title)} (grey: lifted)", fontsize=10)
    lower.plot(phase, 1e6 * results.rise, color=BASE, label="centre of mass")
    lower.plot(phase, 1e6 * results.gap, color=BASE, ls=":", label="lowest layers")
    lower.legend(loc="upper left", frameon=False)
    lower.set_ylabel("rise [µm]", color=BASE)
    other = lower.twinx()
    other.plot(phase, results.coordination, color=BED)
    other.set_ylabel("contacts per particle", color=BED)
    lower.set_xlabel("phase [deg]")
    lower.set_xlim(0, 360)
    return figure


def _voidage(case: DemCase, results: Results) -> Figure:
    figure = Figure(figsize=(6.5, 3.6), layout="constrained")
    axis = figure.subplots()
    d = case.build_powder().diameter
    image = axis.pcolormesh(
        results.curve.phase, results.heights / d, 1.0 - results.solid.T, vmin=0.3, vmax=1.0, cmap="cividis"
    )
    figure.colorbar(image, label="voidage")
    highest = results.heights[results.solid.max(axis=0) > 0.01].max() / d
    axis.set(
        xlabel="phase [deg]",
        ylabel="height above the base [particle diameters]",
        title=literal(case.title),
        ylim=(0, highest + 2),
    )
    return figure


def _depth(case: DemCase, results: Results) -> Figure:
    figure = Figure(figsize=(4.5, 4.0), layout="constrained")
    axis = figure.subplots()
    filled = results.solid.mean(axis=0) > 0.1
    axis.plot(
        100 * results.layer_velocity[filled],
        results.heights[filled] / case.build_powder().diameter,
        color=BED,
    )
    axis.set(
        xlabel="mean velocity along the base [cm/s]",
        ylabel="height above the base [particle diameters]",
        title=literal(case.title),
    )
    return figure


def _residence(case: DemCase, results: Results) -> Figure:
    figure = Figure(figsize=(4.5, 3.4), layout="constrained")
    axis = figure.subplots()
    times = results.residence[np.isfinite(results.residence)]
    if not len(times):
        axis.text(0.5, 0.5, "no particle has come so far", ha="center", transform=axis.transAxes)
    else:
        axis.hist(times, bins=40, range=(0.0, float(np.quantile(times, 0.98))), color=BED)
    length = 1e3 * case.profile.residence_length
    axis.set(xlabel=f"time to travel {length:g} mm [s]", ylabel="particles", title=literal(case.title))
    return figure


def _bed(spec: BoxSpec, particles: Particles) -> Figure:
    """Side view of the last state, coloured by the velocity along the base relative to it."""
    position = particles.position.copy()
    tall = 1.15 * float(position[:, 2].max()) / spec.length
    figure = Figure(figsize=(min(8.0, 5.0 / tall) + 1.5, min(8.0 * tall, 5.0) + 0.8), layout="constrained")
    axis = figure.subplots()
    position[:, 0] %= spec.length
    order = np.argsort(-position[:, 1])
    radius = spec.diameters[particles.classes] / 2.0
    from matplotlib.collections import EllipseCollection

    def spheres(x: Floats, z: Floats, size: Floats | float, **style: Any) -> EllipseCollection:
        width = np.broadcast_to(1e3 * np.asarray(size), x.shape)
        offsets = np.column_stack([1e3 * x, 1e3 * z])
        return EllipseCollection(
            width,
            width,
            np.zeros_like(width),
            units="xy",
            offsets=offsets,
            offset_transform=axis.transData,
            **style,
        )

    if not spec.base.flat:
        glued = spec.base.positions
        axis.add_collection(spheres(glued[:, 0], glued[:, 2], spec.base.diameter, facecolor="0.6"))
    bed = spheres(
        position[order, 0],
        position[order, 2],
        2 * radius[order],
        edgecolor="k",
        linewidth=0.2,
        cmap="viridis",
    )
    bed.set_array(100 * particles.velocity[order, 0])
    axis.add_collection(bed)
    figure.colorbar(bed, label="velocity relative to the base [cm/s]")
    axis.set(
        xlim=(0, 1e3 * spec.length), ylim=(-0.05 * 1e3 * spec.length, 1.1e3 * float(position[:, 2].max()))
    )
    axis.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal")
    return figure
