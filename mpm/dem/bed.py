"""What the bed of a finished DEM run is: voidage, Bond numbers, fluidisation, rarefaction of its gas."""

from typing import Any

from mpm.arrays import Floats
from mpm.physics.fluidisation import (
    granular_bond_number,
    minimum_fluidisation_velocity,
    wen_yu_minimum_fluidisation,
)

from .case import DemCase
from .cohesion import largest_force
from .spec import BoxSpec


def bond_numbers(spec: BoxSpec) -> dict[str, float]:
    """Granular Bond numbers between two particles of the mean size, and between one and the base: force in contact over weight.

    `bond_number_*` of the real material's Hamaker constants, `simulated_bond_number_*` of those in the box, which are
    scaled with its spring. Over a frit the base is one of its particles (radius R_p R_f/(R_p + R_f)), as in the box;
    the seed's numbers for the base (table 3.3) are those of a flat wall.
    """
    powder = spec.powder
    own, glued = powder.diameter / 2.0, spec.base.diameter / 2.0
    radii = {"pair": own / 2.0, "base": own if spec.base.flat else own * glued / (own + glued)}
    out: dict[str, float] = {}
    for name, radius in radii.items():
        real = powder.wall_hamaker if name == "base" else powder.hamaker
        for prefix, hamaker in (("", real * spec.cohesion), ("simulated_", spec.hamaker(name == "base"))):
            force = largest_force(hamaker=hamaker, radius=radius, asperity=powder.asperity)
            out[f"{prefix}bond_number_{name}"] = granular_bond_number(
                cohesion=force, diameter=powder.diameter, density=powder.density
            )
    return out


def bed_numbers(case: DemCase, spec: BoxSpec, heights: Floats, solid: Floats) -> dict[str, Any]:
    """Voidage of the bed at its densest phase, granular Bond numbers, minimum fluidisation, mean free path of the gas.

    `solid` (phases, bins): solid fraction at `heights` (bins,) [m].
    """
    powder = spec.powder
    gas = case.gas
    d = powder.diameter
    core = (heights > 2.0 * d) & (heights < 0.7 * case.box.height * d)
    porosity = 1.0 - float(solid[:, core].mean(axis=1).max()) if core.any() else None
    out: dict[str, Any] = {"porosity": porosity, "measured_minimum_fluidisation": powder.measured_umf}
    out |= bond_numbers(spec)
    if gas is not None:
        out["mean_free_path"] = gas.mean_free_path
        out["knudsen_number"] = gas.mean_free_path / d
    if gas is not None and porosity is not None:
        out["minimum_fluidisation_ergun"] = minimum_fluidisation_velocity(
            diameter=d,
            sphericity=powder.sphericity,
            density_solid=powder.density,
            porosity=porosity,
            viscosity=gas.viscosity,
            density_gas=gas.density,
            ergun=powder.ergun,
        )
        out["minimum_fluidisation_wen_yu"] = wen_yu_minimum_fluidisation(
            diameter=d, density_solid=powder.density, viscosity=gas.viscosity, density_gas=gas.density
        )
    out["weight_of_a_particle"] = powder.weight
    return out
