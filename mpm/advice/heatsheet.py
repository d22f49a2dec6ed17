"""Rows about temperature on the sheet of a case: what is held at which temperature, how layers conduct, what comes of it."""

from __future__ import annotations

from typing import Any

from mpm.case.case import Case
from mpm.case.marks import Marked
from mpm.case.walls import Wall
from mpm.screen import Sheet, number


def temperature_rows(sheet: Sheet, case: Case, report: dict[str, Any], marked: Marked) -> None:
    """The group of a case with [energy]; nothing in another."""
    if case.energy is None:
        return
    energy = report["energy"]
    sheet.group("Temperature")
    sheet.add("gas and solids at the start", marked.text("energy.initial_temperature"))
    if case.conveying_velocity != 0.0 and case.geometry.bed_inflow == "fresh":
        sheet.add("solids that come in", marked.text("geometry.bed_temperature"))
    for inlet in case.geometry.inlets:
        sheet.add(f"gas from inlet {inlet.name}", marked.text(f"geometry.inlet.{inlet.name}.temperature"))
    for wall in case.geometry.walls:
        sheet.add(f"wall {wall.name} ({_side(wall)})", _condition(wall, marked))
    sheet.add("all other walls", "insulated")
    sheet.add("heat capacity of the gas", marked.text("gas.heat_capacity"))
    for layer in reversed(case.geometry.layers):
        numbers = energy["layers"][layer.name]
        conducts = f"{number(numbers['conductivity'], 'W/m/K')}, {_model(numbers['model'], marked)}"
        sheet.add(f"{layer.name} conducts", conducts)
        sheet.add("holds", number(numbers["heat_capacity"], "J/m^3/K"), part=True)
        sheet.add("heated by", marked.text(f"geometry.layer.{layer.name}.heating"), part=True)
    for key, heat in energy["heat_of_reaction"].items():
        known = key not in energy["without_heat"]
        sheet.add(f"heat of reaction {key}", number(heat / 1e3, "kJ/mol") if known else "none known")
    sheet.add("weight of lighter gas", "counts" if case.energy.buoyancy else "does not count")
    if case.fidelity != "steady":
        sheet.add("flow is solved anew when T changes by", f"{100.0 * case.energy.flow_update:g}\u00a0%")


def _model(model: str, marked: Marked) -> str:
    """What a conductivity is of."""
    if model == "gas":
        return "the gas alone"
    if model == "given":
        return "its effective_conductivity"
    return model.replace("_", " ") + marked.mark("energy.conductivity_model")


def _side(wall: Wall) -> str:
    return f"{wall.side}, {number(wall.start * 1e3)} to {number(wall.end * 1e3, 'mm', 6)}"


def _condition(wall: Wall, marked: Marked) -> str | None:
    place = f"geometry.{wall.key}"
    if wall.temperature is not None:
        return f"held at {marked.text(f'{place}.temperature')}"
    if wall.heat_flux is not None:
        return f"gives {marked.text(f'{place}.heat_flux')}"
    return f"{marked.text(f'{place}.heat_transfer_coefficient')} from surroundings at {marked.text(f'{place}.ambient')}"


def heat_numbers(sheet: Sheet, report: dict[str, Any]) -> None:
    """Rows of the group of numbers that are worked out on paper."""
    energy = report.get("energy")
    if energy is None:
        return
    bed = energy.get("bed", {})
    if "diffusion_time" in bed:
        sheet.add("heat through the bed, h^2/alpha", number(bed["diffusion_time"], "s"))
    if "residence_over_diffusion_time" in bed:
        sheet.add("time of the bed in the strip over that", number(bed["residence_over_diffusion_time"]))
    if "wall_time" in bed:
        sheet.add("walls warm the bed, through what is between", number(bed["wall_time"], "s"))
    if "exchange_time" in bed:
        sheet.add("heat from gas to particles", number(bed["exchange_time"] * 1e3, "ms"))
    for name, numbers in energy["layers"].items():
        for key, label in (("Rayleigh", "Rayleigh number"), ("Darcy_Rayleigh", "Darcy-Rayleigh number")):
            if key in numbers:
                limit = number(numbers[f"critical_{key}"], digits=4 if key[0] == "D" else 5)
                sheet.add(f"{label} of {name}, at most", f"{number(numbers[key])} (turns over above {limit})")
    for key, rise in bed.get("adiabatic_rise", {}).items():
        if key not in energy["without_heat"]:
            sheet.add(f"{key} on all sites warms the bed by", number(rise * 1e3, "mK"))
