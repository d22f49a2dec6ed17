"""What `mpm check` prints: the case and its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from mpm.case import Case
from mpm.errors import printable
from mpm.screen import Listing


def print_report(case: Case, report: dict[str, Any], console: Console) -> None:
    """Print the case and its numbers as tables."""
    mesh, run = report["mesh"], report["run"]
    title = Text(printable(case.title) or "case", style="bold")
    console.print(title.append(f": {case.fidelity}, to {case.time.end:g} s", style="not bold"))
    console.print(
        f"{mesh['cells']:,} cells ({mesh['columns']} columns of {mesh['column_width'] * 1e3:.3g} mm, {mesh['rows']} rows), "
        f"{run['steps']:,} steps, about {run['peak_memory_bytes'] / 1e9:.1f} GB, CFL {run['flow_courant']:.2g}"
    )
    for listing in (_layer_table(case), _port_table(case, report), _number_table(case, report)):
        listing.print(console)
    for reaction in report["reactions"]:
        console.print(printable(reaction))
    for sentence in report["without_effect"]:
        console.print(Text("has no effect: ", style="yellow").append(printable(sentence), style="default"))
    for warning in report["warnings"]:
        console.print(Text("warning:", style="yellow").append(f" {printable(warning)}", style="default"))


def _layer_table(case: Case) -> Listing:
    table = Listing(
        "layer", "height [mm]", "rows", "material", "porosity", "k [um2]", "tau2", "S [1/m]", "sites [mol/m2]"
    )
    for layer in reversed(case.geometry.layers):
        cells = [
            layer.name + (" (moving)" if layer.moving else ""),
            f"{layer.height * 1e3:g}",
            str(layer.cells),
        ]
        material = layer.material
        if material is None:
            table.add_row(*cells, "gas")
            continue
        table.add_row(
            *cells,
            layer.material_name,
            f"{material.porosity:g}",
            _pair(k * 1e12 for k in material.permeability),
            _pair(material.tortuosity_factor),
            f"{material.surface_to_volume:g}",
            f"{material.site_density:.3g}",
        )
    return table


def _pair(values: Iterable[float]) -> str:
    return " / ".join(dict.fromkeys(f"{value:.3g}" for value in values))


def _port_table(case: Case, report: dict[str, Any]) -> Listing:
    table = Listing(
        "port",
        "at [mm]",
        "width [mm]",
        "v [cm/s]",
        "mass fractions",
        "doses [s]",
        "Re",
        "excess",
        "dose ratio",
    )
    for inlet in case.geometry.inlets:
        numbers = report["inlets"][inlet.name]
        feed = ", ".join(f"{name} {value:g}" for name, value in inlet.mass_fractions.items())
        times = ", ".join(f"{a:g}-{b:g}" if b < math.inf else f"from {a:g}" for a, b in inlet.windows)
        table.add_row(
            inlet.name,
            f"{inlet.center * 1e3:g}",
            f"{inlet.width * 1e3:g}",
            f"{inlet.velocity * 1e2:g}",
            feed or case.gas.carrier,
            times if feed else "",
            f"{numbers['Re']:.3g}",
            *(f"{numbers[key]:.3g}" if key in numbers else "" for key in ("excess_number", "dose_ratio")),
        )
    for outlet in case.geometry.outlets:
        table.add_row(f"{outlet.name} (outlet)", f"{outlet.center * 1e3:g}", f"{outlet.width * 1e3:g}")
    return table


def _number_table(case: Case, report: dict[str, Any]) -> Listing:
    table = Listing("quantity", "value", "unit")
    motion, bed, gas = report["motion"], report.get("bed", {}), report["gas"]

    def row(name: str, value: float | None, unit: str = "", scale: float = 1.0) -> None:
        if value is not None:
            table.add_row(name, f"{value * scale:.4g}", unit)

    row("gas density", gas["density"], "kg/m3")
    row("gas viscosity", gas["viscosity"], "Pa s")
    for value, origin in dict.fromkeys(
        (d, gas["diffusivity_from"][s]) for s, d in gas["diffusivity"].items()
    ):
        alike = [
            s for s, d in gas["diffusivity"].items() if (d, gas["diffusivity_from"][s]) == (value, origin)
        ]
        row(f"diffusivity, {origin}: {', '.join(alike)}", value, "m2/s")
    row("mean free path of the gas", gas["mean_free_path"], "um", 1e6)
    for name, pores in report["pores"].items():
        row(f"{name}: diameter of its pores, sqrt(32 tau2 k/porosity)", pores["diameter"], "um", 1e6)
        row(f"{name}: Knudsen number, mean free path over it", pores["Knudsen"])
    row("amplitude, horizontal", motion["amplitude_x"], "mm", 1e3)
    row("amplitude, vertical", motion["amplitude_y"], "mm", 1e3)
    row("peak velocity, horizontal (perfect flight)", motion["perfect_flight"], "cm/s", 1e2)
    row("peak velocity, vertical", motion["peak_velocity_y"], "cm/s", 1e2)
    row("straight drop limit", motion["straight_drop"], "cm/s", 1e2)
    mean = "" if case.motion.table is None else f", mean of {Path(case.motion.profile).name}"
    row(f"bed velocity{mean}", motion["bed_velocity"], "cm/s", 1e2)
    row("time of the bed in the strip", bed.get("residence_time"), "s")
    row("gas rising through the bed, at most", bed.get("gas_velocity"), "cm/s", 1e2)
    row("minimum fluidisation, Ergun", bed.get("minimum_fluidisation_ergun"), "cm/s", 1e2)
    row("minimum fluidisation, Wen and Yu", bed.get("minimum_fluidisation_wen_yu"), "cm/s", 1e2)
    row("gas velocity over minimum fluidisation", bed.get("gas_over_minimum_fluidisation"))
    row("pressure drop of the bed", bed.get("pressure_drop"), "Pa")
    row("Re of a particle", bed.get("Re_particle"))
    for name, numbers in report["inlets"].items():
        row(f"{name}: Pe through the bed", numbers.get("Pe_bed"))
        row(f"{name}: Damkoehler, over convection", numbers.get("Damkoehler_convection"))
        row(f"{name}: Damkoehler, over diffusion", numbers.get("Damkoehler_diffusion"))
        row(f"{name}: reaction front", numbers.get("front_thickness"), "um", 1e6)
        row(f"{name}: lifetime of a site", numbers.get("site_lifetime"), "us", 1e6)
        row(f"{name}: lifetime in the gas", numbers.get("gas_lifetime"), "us", 1e6)
    return table
