"""Numbers of a case beyond what the model, its grid or its steps hold for: one sentence each, as warnings of `mpm check`.

`report` holds the numbers of `mpm.advice.checks`, SI.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpm.case.case import Case

SMEARED = 0.1
"""Numerical over molecular diffusion along x that deserves a warning; what it does to the coverage before the inlet is in
docs/vibration.md."""
CONTINUUM = 0.01
"""Knudsen number of the pores from which slip counts: it adds 8 Kn to the permeability (Klinkenberg 1941), 8 % here."""
FEW = 10.0
"""Particles across a layer below which averages over its pores mean little: near a wall the porosity swings for about five diameters
(Benenati and Brosilow 1962)."""
DILUTE = 0.02
"""Mass fraction above which a feed is no longer dilute: the gas keeps the density and viscosity of its carrier."""


def beyond_limits(case: Case, report: dict[str, Any]) -> list[str]:
    """All that is to be said of a case."""
    return [
        *_flight(case, report),
        *_fluidisation(report),
        *_particles(case),
        *_feeds(case),
        *_slip(case, report),
        *_courant(case, report),
        *_smearing(case, report),
        *_stripes(case, report),
    ]


def _flight(case: Case, report: dict[str, Any]) -> Iterator[str]:
    """A bed that is conveyed faster than a particle can hop."""
    speed, fastest = abs(case.motion.mean_velocity), report["motion"]["perfect_flight"]
    if case.motion.gamma > 0.0 and "bed" in report and speed > fastest:
        yield (
            f"the bed is conveyed at {speed * 100:.3g} cm/s, above perfect flight, {fastest * 100:.3g} cm/s: no particle hops that fast"
        )


def _fluidisation(report: dict[str, Any]) -> Iterator[str]:
    """Gas that would lift the bed."""
    bed = report.get("bed", {})
    ratio = bed.get("gas_over_minimum_fluidisation", 0.0)
    if ratio > 1.0:
        yield (
            f"gas rises through the bed at {bed['gas_velocity'] * 100:.3g} cm/s, {ratio:.2g} times minimum fluidisation "
            f"({bed['minimum_fluidisation_ergun'] * 100:.3g} cm/s, Ergun): a real bed would expand or bubble, the model keeps it packed; "
            f"{1.0 / ratio:.2g} times the flow of the inlets below would leave it at rest"
        )


def _particles(case: Case) -> Iterator[str]:
    """Layers of few particles."""
    for layer in case.geometry.layers:
        size = layer.material.particle_diameter if layer.material is not None else None
        if size is not None and layer.height < FEW * size:
            yield (
                f"layer {layer.name} is {layer.height * 1e3:.3g} mm high, {layer.height / size:.2g} particles of {size * 1e6:.3g} um: "
                f"below {FEW:g} it is no continuum, and porosity and permeability are not those of a deep bed"
            )


def _feeds(case: Case) -> Iterator[str]:
    """Feeds that are not dilute."""
    for inlet in case.geometry.inlets:
        feed = sum(inlet.mass_fractions.values())
        if feed > DILUTE:
            yield (
                f"inlet {inlet.name} feeds a mass fraction of {feed:.3g}, not dilute (above {DILUTE}): density and "
                "viscosity stay those of the carrier"
            )


def _slip(case: Case, report: dict[str, Any]) -> Iterator[str]:
    """Pores in which gas is no continuum and the case does not say how wide they are."""
    told = {layer.name for layer in case.geometry.layers if layer.material and layer.material.pore_diameter}
    for name, pores in report["pores"].items():
        kn = pores["Knudsen"]
        if kn > CONTINUUM and name not in told:
            yield (
                f"layer {name}: Kn = {kn:.2g}, mean free path {report['gas']['mean_free_path'] * 1e6:.2g} um over pores of "
                f"{pores['diameter'] * 1e6:.3g} um: outside the continuum (Kn above {CONTINUUM:g}) gas slips at walls; "
                f"permeability should be about 1 + 8 Kn = {1.0 + 8.0 * kn:.3g} times as large (Klinkenberg), D_eff smaller"
            )


def _courant(case: Case, report: dict[str, Any]) -> Iterator[str]:
    """Steps of the cycle in which gas passes more than a cell."""
    courant = report["run"]["flow_courant"]
    if courant > 1.0 and case.follows_cycle:
        yield (
            f"the gas passes {courant:.2g} cells in a step of the cycle (CFL above 1): raise time.steps_per_cycle"
        )


def _smearing(case: Case, report: dict[str, Any]) -> Iterator[str]:
    """Columns so wide that upwinding diffuses, which is a part of every scheme."""
    added, width = report["run"]["numerical_diffusion"], report["mesh"]["column_width"]
    if added > SMEARED and case.fidelity != "steady":
        otherwise = ", or fidelity averaged, which has no swinging gas" if case.fidelity == "resolved" else ""
        yield (
            f"upwinding in columns of {width * 1e3:.3g} mm adds {100 * added:.3g} per cent to diffusion "
            f"along the bed: narrower columns (geometry.cell_width){otherwise}"
        )


def _stripes(case: Case, report: dict[str, Any]) -> Iterator[str]:
    """Steps in which the bed passes more than a column."""
    if case.fidelity != "averaged" or "bed" not in report:
        return
    speed, width = abs(case.motion.mean_velocity), report["mesh"]["column_width"]
    columns = speed * report["run"]["step"] / width
    if columns > 1.0 + 1e-6:
        yield (
            f"the bed moves {columns:.2g} columns in a step, which leaves stripes of single columns in the coverage: lower time.step "
            f"to {math.ceil(1e4 * width / speed) / 10:g} ms, unless means are all that is wanted"
        )
