"""What decides the answer of a case without anybody having typed it, and numbers that `mpm check` cannot give. One sentence each.

Nothing here is wrong with the case: warnings are in `mpm.advice.limits` and `mpm.advice.caveats`, keys that nothing reads in
`mpm.advice.idle`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm.advice.engineering import sites_per_square_nanometre
from mpm.case.materials import SITE_DENSITIES, Material
from mpm.screen import figure

if TYPE_CHECKING:
    from mpm.case.case import Case


def notes(case: Case) -> list[str]:
    """All that is to be said of a case."""
    return [*_bed_notes(case), *_site_notes(case), *_powder_notes(case)]


def _bed_notes(case: Case) -> list[str]:
    """Whether anything moves."""
    layer = case.geometry.moving_layer
    if layer is None:
        porous = [layer.name for layer in case.geometry.layers if layer.material is not None]
        if not porous:
            return []
        keys = " or ".join(f"geometry.layer.{name}.moving" for name in porous)
        return [f"no layer moves, so nothing is conveyed and no dose per site can be given ({keys} = true)"]
    if case.conveying_velocity == 0.0:
        why = "its forces do not convey it" if case.motion.balances else "motion.bed_velocity is 0 cm/s"
        return [
            f"layer {layer.name} does not move ({why}): no solids pass, so there is no dose per site and no "
            "time in the strip"
        ]
    return []


def _used(case: Case) -> dict[str, Material]:
    """The materials of the layers by name, that of the moving layer first."""
    return {
        layer.material_name: layer.material
        for layer in sorted(case.geometry.layers, key=lambda layer: not layer.moving)
        if layer.material is not None and layer.material_name is not None
    }


def _site_notes(case: Case) -> list[str]:
    """Materials whose sites nobody has counted."""
    left_out = [name for name in _used(case) if "site_density" not in case.materials[name].model_fields_set]
    if not left_out:
        return []
    default, full = (SITE_DENSITIES[name] for name in ("thesis", "one-per-24-square-angstrom"))
    here = f"{figure(sites_per_square_nanometre(default), 'sites per nm^2', 3)} ({figure(default, 'mol/m^2', 3)})"
    there = f"{figure(sites_per_square_nanometre(full), 'per nm^2', 3)} ({figure(full, 'mol/m^2', 3)})"
    return [
        f"site_density of {' and '.join(left_out)} is the default, {here}: a hundredth of one site per 24 square angstrom, {there}, "
        f'which material.{left_out[0]}.site_density = "one-per-24-square-angstrom" gives; doses grow with it'
    ]


def _powder_notes(case: Case) -> list[str]:
    """A powder of which too little is known to say when it fluidises."""
    layer = case.geometry.moving_layer
    if layer is None or layer.material is None:
        return []
    missing = [key for key in ("density", "particle_diameter") if getattr(layer.material, key) is None]
    if not missing:
        return []
    keys = " and ".join(f"material.{layer.material_name}.{key}" for key in missing)
    return [f"no minimum fluidisation can be given: {keys} {'are' if ' and ' in keys else 'is'} missing"]
