"""The case and its numbers in groups, `label   value`: on the screen of `mpm check`, in a notebook and on the report page."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from mpm.advice.heatsheet import heat_numbers, temperature_rows
from mpm.advice.motion import force_rows
from mpm.case.case import Case
from mpm.case.marks import Marked, value_text
from mpm.case.ports import Inlet
from mpm.report.rateunits import peculiar_orders
from mpm.report.verdict import percent
from mpm.screen import Listing, Sheet, number, together


def case_sheet(case: Case, report: dict[str, Any], marked: Marked) -> Sheet:
    """The case and its numbers in groups."""
    sheet = Sheet(room=40)
    _strip(sheet, case, report, marked)
    _powders(sheet, case, report, marked)
    _gas(sheet, case, report, marked)
    _ports(sheet, case, report, marked)
    _motion(sheet, case, report, marked)
    temperature_rows(sheet, case, report, marked)
    _conventions(sheet, report, marked)
    _engineering(sheet, report)
    _cost(sheet, case, report, marked)
    return sheet


def _strip(sheet: Sheet, case: Case, report: dict[str, Any], marked: Marked) -> None:
    geometry, mesh = case.geometry, report["mesh"]
    sheet.group("Strip")
    sheet.add("length", marked.text("geometry.length"))
    ends = (
        "periodic: gas leaving at the right comes back at the left"
        if geometry.periodic
        else "closed by walls"
    )
    sheet.add("ends", ends + marked.mark("geometry.periodic"))
    if case.conveying_velocity != 0.0:
        side = "left" if case.direction > 0 else "right"
        solids = {
            "fresh": f"fresh, at the {side}",
            "periodic": f"at the {side} as they left at the other end",
        }
        sheet.add("solids come in", solids[geometry.bed_inflow] + marked.mark("geometry.bed_inflow"))
    layers = Listing("layer", "height [mm]", "rows", "material")
    for layer in reversed(geometry.layers):
        way = " (moving)" if case.conveying_velocity != 0.0 else " (does not move)"
        name = layer.name + (way if layer.moving else "")
        height = f"{layer.height * 1e3:.6g}"
        layers.add_row(name, height, str(layer.cells), layer.material_name or "gas")
    sheet.list(layers)
    for zone in geometry.zones:
        dosed = f", dosed by {zone.inlet}" if zone.inlet else ""
        sheet.add(
            f"zone {zone.name}", f"{number(zone.start * 1e3)} to {number(zone.end * 1e3, 'mm', 6)}{dosed}"
        )
    columns = f"{mesh['columns']} columns of {number(mesh['column_width'] * 1e3, 'mm', 3)}"
    mark = marked.mark("geometry.cell_width")
    sheet.add("mesh", f"{mesh['cells']:,} cells: {columns}{mark}, {mesh['rows']} rows")


_POWDER = (
    ("porosity", "porosity"),
    ("permeability", "permeability"),
    ("tortuosity_factor", "tortuosity factor"),
    ("surface_to_volume", "surface per total volume"),
    ("density", "density of the solid"),
    ("particle_diameter", "particle diameter"),
    ("sphericity", "sphericity"),
)


def _powders(sheet: Sheet, case: Case, report: dict[str, Any], marked: Marked) -> None:
    for layer in reversed(case.geometry.layers):
        material, name = layer.material, layer.material_name
        if material is None or name is None:
            continue
        sheet.group(f"{layer.name}: {name}")
        for key, label in _POWDER:
            if key == "sphericity" and material.particle_diameter is None:
                continue
            sheet.add(label, marked.text(f"material.{name}.{key}"))
        key = f"material.{name}.site_density"
        per_area = number(report["sites_per_nm2"][layer.name], "sites per nm^2", 3)
        sheet.add("surface sites", f"{per_area}, {marked.text(key)}")
        covered = [
            f"{site} {share:g}{marked.mark(f'material.{name}.initial_coverage.{site}')}"
            for site, share in material.initial_coverage.items()
            if share
        ]
        sheet.add("share of the sites at first", ", ".join(covered))
        pores = report["pores"][layer.name]
        if material.pore_diameter is not None:
            sheet.add("pores", f"{marked.text(f'material.{name}.pore_diameter')} wide")
        elif "diameter" in pores:
            sheet.add("pores, as straight capillaries", number(pores["diameter"] * 1e6, "um wide"))
        if "Knudsen" in pores:
            kn = number(pores["Knudsen"], digits=3)
            sheet.add("Knudsen number of the pores", f"{kn} (gas is a continuum below 0.01)")
        if "permeability_factor" in pores:
            sheet.add("slip multiplies permeability by", number(pores["permeability_factor"]), part=True)
            shares = [f"{name} {number(share)}" for name, share in pores["diffusivity_factor"].items()]
            sheet.add("walls multiply diffusivity by", ", ".join(shares), part=True)


def _gas(sheet: Sheet, case: Case, report: dict[str, Any], marked: Marked) -> None:
    gas = report["gas"]
    sheet.group("Gas and reactions")
    for key in ("carrier", "temperature", "pressure", "density", "viscosity"):
        sheet.add(key, marked.text(f"gas.{key}"))
    if "mean_free_path" in gas:
        sheet.add("mean free path", number(gas["mean_free_path"] * 1e6, "um"))
    alike: dict[str, list[str]] = {}
    for species in gas["diffusivity"]:
        scaled = gas["diffusivity_from"][species] == "scaled"
        origin = (
            " (worked out: scaled from 2.88e-5\u00a0m^2/s in N2 at 473\u00a0K, 101325\u00a0Pa)"
            if scaled
            else marked.mark(f"gas.diffusivity.{species}")
        )
        text = value_text(marked.values[f"gas.diffusivity.{species}"]) + origin
        alike.setdefault(text, []).append(species)
    for text, names in alike.items():
        sheet.add("diffusivity" if len(alike) == 1 else f"diffusivity of {', '.join(names)}", text)
    for index, reaction in enumerate(case.mechanism.reactions):
        mark = marked.mark("chemistry.mechanism")
        label = f"mechanism {case.chemistry.mechanism}{mark}" if index == 0 else ""
        odd = peculiar_orders(reaction)
        text = f"{reaction} ({odd})" if odd else str(reaction)
        sheet.add(label or "and", re.sub(r"(?<=\b\d) (?=\S)", "\u00a0", text))


def _ports(sheet: Sheet, case: Case, report: dict[str, Any], marked: Marked) -> None:
    sheet.group(
        f"Ports ({together('sccm/m')}: standard cm^3/min per metre of depth, at {together('0 degC')} and {together('101325 Pa')})"
    )
    for kind, ports in (("inlet", case.geometry.inlets), ("outlet", case.geometry.outlets)):
        for port in ports:
            place = f"geometry.{kind}.{port.name}"
            side = "below" if port.side == "bottom" else "above"
            where = f"at {marked.text(f'{place}.center')}, {marked.text(f'{place}.width')} wide"
            sheet.add(f"{kind} {port.name}, {side}", where)
            if isinstance(port, Inlet):
                _feed(sheet, case, port, report["inlets"][port.name], marked)


def _feed(sheet: Sheet, case: Case, inlet: Inlet, numbers: dict[str, Any], marked: Marked) -> None:
    """What an inlet blows, and how much that is."""
    place = f"geometry.inlet.{inlet.name}"
    flow = f"{number(numbers['sccm_per_metre'], 'sccm/m')}, Re {number(numbers['Re'], digits=3)}"
    sheet.add("flow", f"{marked.text(f'{place}.velocity')}, {flow}", part=True)
    if not inlet.mass_fractions:
        sheet.add("feeds", f"{case.gas.carrier} alone", part=True)
    for species, fraction in inlet.mass_fractions.items():
        mole = number(numbers["mole_fractions"][species])
        sheet.add(
            f"feeds {species}",
            f"mass fraction {number(fraction)}, mole fraction {mole}, {_windows(inlet, marked)}",
            part=True,
        )
    if "excess_number" in numbers:
        sheet.add(
            "dose",
            f"{number(numbers['excess_number'], digits=3)} molecules per passing site{_saturation(numbers)}",
            part=True,
        )


def _saturation(numbers: dict[str, Any]) -> str:
    """How a dose compares with what saturation takes; where reactions go back, that leaves some of the sites as they were."""
    if "endless" in numbers:
        return ", taken up without end"
    if "dose_ratio" not in numbers:
        return ""
    text = f", {number(numbers['dose_ratio'], digits=3)} times what saturates"
    covered = numbers.get("saturated_coverage", 1.0)
    return text if covered > 0.99 else f"{text}: {percent(covered)} of the sites, where reactions go back"


def _windows(inlet: Inlet, marked: Marked) -> str:
    """When an inlet doses."""
    times = [
        f"from {a:g}\u00a0s" + (" on" if math.isinf(b) else f" to {b:g}\u00a0s") for a, b in inlet.windows
    ]
    mark = marked.mark(f"geometry.inlet.{inlet.name}.start") if len(inlet.windows) == 1 else ""
    return ", ".join(times) + mark


def _motion(sheet: Sheet, case: Case, report: dict[str, Any], marked: Marked) -> None:
    motion, told = report["motion"], " ".join(report["without_effect"])
    heading = "Motion"
    if not case.follows_cycle and case.motion.gamma > 0.0 and "motion.gamma" not in told:
        heading += (
            f" (of which fidelity {case.fidelity} sees the bed's mean velocity alone, not the vibration)"
        )
    sheet.group(heading)
    sheet.add("vertical acceleration over g", marked.text("motion.gamma"))
    if case.motion.gamma > 0.0:
        sheet.add("frequency", marked.text("motion.frequency"))
        angle_from = marked.text("motion.angle_from")
        sheet.add("angle", f"{marked.text('motion.angle')} from the {angle_from}")
        for label, key in (("horizontal", "x"), ("vertical", "y")):
            amplitude = number(motion[f"amplitude_{key}"] * 1e3, "mm")
            peak = number(motion[f"peak_velocity_{key}"] * 1e2, "cm/s")
            sheet.add(f"{label} amplitude, peak velocity", f"{amplitude}, {peak}")
    if case.geometry.moving_layer is not None:
        speed = number(motion["bed_velocity"] * 1e2, "cm/s")
        text = marked.text("motion.bed_velocity")
        if case.motion.balances:
            text = f"{speed}, from weight, gas and friction"
        elif case.motion.table is not None:
            text = f"{speed}, the mean of {Path(case.motion.profile).name}"
        sheet.add("mean velocity of the bed", text)
        if case.follows_cycle or case.motion.balances:
            sheet.add("profile of the bed's velocity", marked.text("motion.profile"))
        force_rows(sheet, motion, marked)
        if case.motion.gamma > 0.0 and "perfect_flight" in motion:
            limits = f"{number(motion['straight_drop'] * 1e2)} and {number(motion['perfect_flight'] * 1e2, 'cm/s')}"
            sheet.add("straight drop and perfect flight", f"convey at {limits}")
    if case.fidelity != "steady":
        sheet.add("motion starts at", marked.text("motion.start"))


def _conventions(sheet: Sheet, report: dict[str, Any], marked: Marked) -> None:
    """One row where all are this model's own, else what differs."""
    sheet.group("Conventions")
    found = report["conventions"]
    own = "" if found["differing"] else ": all switches are this model's own"
    sheet.add("preset", f"{found['preset']}{marked.mark('conventions')}{own}")
    for key, words in found["differing"].items():
        sheet.add(key, words + marked.mark(key), part=True)


def _engineering(sheet: Sheet, report: dict[str, Any]) -> None:
    """Numbers that are worked out on paper before a run."""
    sheet.group("Numbers an engineer asks for")

    def row(label: str, value: float | None, unit: str = "", scale: float = 1.0, part: bool = False) -> None:
        sheet.add(label, None if value is None else number(value * scale, unit), part)

    bed = report.get("bed", {})
    row("time of the bed in the strip", bed.get("residence_time"), "s")
    row("gas rising through the bed, at most", bed.get("gas_velocity"), "cm/s", 1e2)
    row("minimum fluidisation, Ergun", bed.get("minimum_fluidisation_ergun"), "cm/s", 1e2)
    row("minimum fluidisation, Wen and Yu", bed.get("minimum_fluidisation_wen_yu"), "cm/s", 1e2)
    row("rising gas over minimum fluidisation", bed.get("gas_over_minimum_fluidisation"))
    row("pressure drop of the bed", bed.get("pressure_drop"), "Pa")
    row("Reynolds number of a particle", bed.get("Re_particle"))
    for name, numbers in report["inlets"].items():
        if "species" not in numbers:
            continue
        sheet.add(f"{numbers['species']} of {name} in the bed", "")
        row("Peclet, convection over diffusion", numbers.get("Pe_bed"), part=True)
        row("Damkoehler, reaction over convection", numbers.get("Damkoehler_convection"), part=True)
        row("Damkoehler, reaction over diffusion", numbers.get("Damkoehler_diffusion"), part=True)
        row("thickness of the reaction front", numbers.get("front_thickness"), "um", 1e6, True)
        row("lifetime of a site", numbers.get("site_lifetime"), "us", 1e6, True)
        row("lifetime in the gas", numbers.get("gas_lifetime"), "us", 1e6, True)
    heat_numbers(sheet, report)


def _cost(sheet: Sheet, case: Case, report: dict[str, Any], marked: Marked) -> None:
    run = report["run"]
    sheet.group("Time and cost")
    if case.fidelity == "steady":
        sheet.add("time", "none: the steady state is solved for at once")
    else:
        sheet.add("end", marked.text("time.end"))
        key = "time.steps_per_cycle" if case.fidelity == "resolved" else "time.step"
        asked = (
            f"{marked.text(key)} per cycle"
            if case.fidelity == "resolved"
            else f"at most {marked.text(key)}, fitted to the columns of the bed"
        )
        sheet.add("step", f"{number(run['step'] * 1e3, 'ms')}: {asked}")
        sheet.add("steps", f"{run['steps']:,}")
        sheet.add("output every", marked.text("output.every"))
    sheet.add("memory, about", number(run["peak_memory_bytes"] / 1e9, "GB", 2))
    if case.follows_cycle and "flow_courant" in run:
        sheet.add("Courant number of the gas, at most", number(run["flow_courant"], digits=2))
    if "numerical_diffusion" in run:
        share = number(100.0 * run["numerical_diffusion"], "% of the diffusivity", 3)
        sheet.add("numerical diffusion along the bed", share)
