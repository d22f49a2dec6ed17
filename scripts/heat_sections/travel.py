"""How far the powder travels until it is within 5 K of the walls, by model of conductivity, in the reactor as it is and on a hot plate."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure

from heat_sections.store import (
    COARSE,
    COLD,
    HOT,
    MESHES,
    STEADY,
    Numbers,
    both,
    case_of,
    markdown,
    measured_on,
    run,
)
from mpm import Case, Reactor, load_case
from mpm.advice.checks import check_case
from mpm.arrays import Floats
from mpm.physics.thermal import MODELS
from mpm.pictures.outline import OKABE_ITO
from mpm.pictures.standard import STYLE

WITHIN = 5.0  # K
SPEED = 0.013  # m/s
ENTER = (298.15, 373.15, 423.15, 458.15)  # K, at which powder enters one zone after the other
PLATE = {"parallel": 0.5, "series": 4.0, "geometric": 1.3, "zehner_bauer_schluender": 1.7}
"""Length of the plate [m], half as long again as the way."""
LINE = 25.0  # m, a strip without ports
MODE = math.pi**2 / 4.0
MEAN_AT = math.log(8.0 / math.pi**2 * (HOT - COLD) / WITHIN) / MODE
"""alpha t/h2 at which the mean of a slab on a plate is within 5 K, insulated above: first term of the series (Carslaw and Jaeger 1959)."""
SHARES = np.linspace(0.0, 1.0, 60) ** 2
SLOW = (0.1, 0.03, 0.01)  # cm/s
HEATED = 3.6e7  # W/m3 of the frit


# --- one zone after the other ---


def decay_length(model: str, enters: float, mesh: str) -> float:
    """Way [m] over which the bed's distance from the walls' temperature falls by e, in a zone that it enters at `enters` [K]."""
    changes = {"energy.conductivity_model": model, "geometry.bed_temperature": f"{enters} K"}
    case = case_of("heating", mesh, STEADY, changes)
    leaves = run(f"zone-{model}-{enters:g}-{mesh}", case)["temperature.bed_exit"]
    return case.geometry.length / math.log((HOT - enters) / (HOT - leaves))


def chain(model: str, mesh: str) -> tuple[Floats, Floats]:
    """Way [m] and temperature [K] of powder that passes zone after zone: dx = l(T) dT/(T_w - T), l linear between measured ones."""
    lengths = [decay_length(model, enters, mesh) for enters in ENTER]
    log = np.linspace(math.log(HOT - COLD), math.log(0.5 * WITHIN), 400)
    length = np.interp(HOT - np.exp(log), ENTER, lengths)
    steps = 0.5 * (length[1:] + length[:-1]) * -np.diff(log)
    return np.append(0.0, np.cumsum(steps)), HOT - np.exp(log)


def reached(way: Floats, temperature: Floats) -> float:
    """Way [m] at which a rising temperature is within 5 K of the walls."""
    return float(np.interp(HOT - WITHIN, temperature, way))


# --- strips without ports ---


def strip(length: float, columns: int, layers: list[dict[str, Any]], model: str) -> Case:
    """Layers between a floor and a roof at 200 degC, without ports, the bed entering cold at 1.3 cm/s."""
    walls = [{"side": side, "temperature": f"{HOT} K"} for side in ("bottom", "top")]
    return load_case(
        {
            "fidelity": "steady",
            "geometry": {
                "length": f"{length} m",
                "cell_width": f"{length / columns!r} m",
                "layer": layers,
                "wall": walls,
                "bed_temperature": f"{COLD} K",
            },
            "gas": {"temperature": f"{HOT} K"},
            "energy": {"conductivity_model": model},
            "motion": {"gamma": 0.0, "bed_velocity": f"{SPEED} m/s", "start": "0 s"},
        }
    )


def layers_of(mesh: str, *names: str) -> list[dict[str, Any]]:
    """Layers of the shipped zone, rows as fine as on a mesh."""
    made_of: dict[str, dict[str, Any]] = {
        "plenum": {"height": "5 mm"},
        "frit": {"height": "1.59 mm", "material": "sintered_powder"},
        "bed": {"height": "3 mm", "material": "glass_beads", "moving": True},
        "headspace": {"height": "12.7 mm"},
    }
    cells = {layer.name: layer.cells for layer in case_of("single_zone", mesh).geometry.layers}
    return [{"name": name, "cells": cells[name], **made_of[name]} for name in names]


def profiles(reactor: Reactor) -> Numbers:
    """Way to within 5 K of the bed's mean and of its coldest row, and the mean at `SHARES` of the strip."""
    grid, inside = reactor.grid, reactor.field("temperature")[reactor.grid.moving]
    mean = grid.dy[grid.moving] @ inside / grid.dy[grid.moving].sum()
    ends = 0.5 * grid.dx
    found = {
        "mean": reached(grid.centres + ends, mean),
        "coldest": reached(grid.centres + ends, inside.min(axis=0)),
    }
    places = grid.x[-1] * SHARES
    along = np.interp(places, np.append(0.0, grid.centres + ends), np.append(COLD, mean))
    return found | {f"T{i}": float(value) for i, value in enumerate(along)}


COLUMNS = {"full": 500, "half": 250, COARSE: 60}


def plate(model: str, mesh: str) -> Numbers:
    """The bed on a plate at 200 degC, as on a frit that is held hot, the headspace and its hot roof above."""
    case = strip(PLATE[model], COLUMNS[mesh], layers_of(mesh, "bed", "headspace"), model)
    return run(f"plate-{model}-{mesh}", case, profiles)


def line(model: str, mesh: str) -> Numbers:
    """All four layers of the reactor over 25 m, without ports."""
    layers = layers_of(mesh, "plenum", "frit", "bed", "headspace")
    return run(f"line-{model}-{mesh}", strip(LINE, COLUMNS[mesh], layers, model), profiles)


def heated_frit(model: str, mesh: str) -> Numbers:
    """The zone with a frit that is heated evenly, with as much as takes the powder to the walls' temperature."""
    changes = {"energy.conductivity_model": model, "geometry.layer.frit.heating": f"{HEATED} W/m^3"}
    return run(f"frit-{model}-{mesh}", case_of("heating", mesh, STEADY, changes))


def slow(speed: float, mesh: str) -> Numbers:
    """The zone as it is with a slow bed, `speed` in cm/s."""
    case = case_of("heating", mesh, STEADY, {"motion.bed_velocity": f"{speed} cm/s"})
    return run(f"slow-{speed:g}-{mesh}", case)


# --- tables ---


def table(meshes: tuple[str, ...]) -> str:
    """By model: conductivity, h2/alpha, ways in both settings; then the frit that is heated."""
    lines = []
    for model in MODELS:
        case = case_of("heating", meshes[0], {"energy.conductivity_model": model})
        bed = check_case(case)["energy"]["layers"]["bed"]
        rise = decay_length(model, COLD, meshes[0])
        lines.append(
            [
                f"`{model}`",
                f"{bed['conductivity']:.3f}",
                f"{bed['diffusion_time']:.1f}",
                f"{100 * SPEED * MEAN_AT * bed['diffusion_time']:.0f}",
                both([100 * plate(model, mesh)["mean"] for mesh in meshes], ".1f"),
                both([100 * plate(model, mesh)["coldest"] for mesh in meshes], ".1f"),
                f"{(HOT - COLD) * -math.expm1(-case.geometry.length / rise):.2f}",
                both([reached(*chain(model, mesh)) for mesh in meshes], ".1f"),
                both([line(model, mesh)["mean"] for mesh in meshes], ".1f"),
            ]
        )
    head = [
        "model",
        "k_eff, W/m/K",
        "h²/α, s",
        "plate, theory, cm",
        "plate, mean of the bed, cm",
        "plate, coldest row, cm",
    ]
    head += ["as it is: gain in a zone, K", "as it is: zone after zone, m", "as it is, without ports, m"]
    return (
        f"{measured_on(meshes)}\n\n{markdown(head, lines)}\n\n{slow_table(meshes)}\n\n{heated_table(meshes)}"
    )


def slow_table(meshes: tuple[str, ...]) -> str:
    """At what temperature a slow bed leaves the zone as it is."""
    lines = []
    for speed in SLOW:
        found = [slow(speed, mesh)["temperature.bed_exit"] for mesh in meshes]
        lines.append([f"{speed:g}", f"{13.97 / speed / 60:.0f}", both([HOT - t for t in found], ".1f")])
    return markdown(
        ["as it is, bed, cm/s", "minutes in the zone", "powder leaves colder than the walls by, K"], lines
    )


def heated_table(meshes: tuple[str, ...]) -> str:
    """What an evenly heated frit does."""
    lines = []
    for model in ("parallel", "zehner_bauer_schluender"):
        found = [heated_frit(model, mesh) for mesh in meshes]
        names = (
            "temperature.bed_exit",
            "temperature.bed.max",
            "temperature.frit.min",
            "temperature.frit.max",
        )
        per_metre = found[0]["energy.heating"]
        lines.append(
            [f"`{model}`", f"{per_metre:.0f}", *(both([n[name] for n in found], ".1f") for name in names)]
        )
    head = ["frit heated evenly, model of the bed", "W per metre of width", "powder leaves at, K"]
    return markdown(
        [*head, "hottest of the bed, K", "coldest of the frit, K", "hottest of the frit, K"], lines
    )


def draw() -> Figure:
    """Mean temperature of the bed along its way, on a hot plate and in the reactor as it is."""
    mesh = MESHES[0]
    with style.context(STYLE):
        figure = Figure(figsize=(10.0, 3.9), layout="constrained")
        hot, far = figure.subplots(1, 2, sharey=True)
        for colour, model in zip(OKABE_ITO, MODELS, strict=False):
            name = model.replace("_", " ")
            found = plate(model, mesh)
            means = [found[f"T{i}"] for i in range(len(SHARES))]
            hot.plot(PLATE[model] * SHARES, means, color=colour, label=name)
            far.plot(*chain(model, mesh), color=colour, label=name)
        for panel, title in (
            (hot, "on a frit that is held at 200 °C"),
            (far, "in the reactor as it is: floor and roof at 200 °C"),
        ):
            panel.axhline(HOT - WITHIN, color="0.4", linewidth=0.9, linestyle=(0, (4, 3)))
            panel.set_title(title, fontsize=10)
            panel.set_xlabel("way of the powder [m]")
            panel.grid(alpha=0.25)
        hot.set(ylabel="temperature of the bed, mean [K]", xlim=(0.0, 2.6))
        hot.axvspan(0.0, 0.1397, color="0.9", zorder=0)
        hot.annotate("one zone", (0.16, 305.0), fontsize=8, color="0.35")
        far.set_xlim(0.0, 22.0)
        hot.legend(fontsize=8, loc="lower right", title="dashed: 5 K below the walls", title_fontsize=8)
    return figure
