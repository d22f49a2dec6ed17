"""How a species spreads: diffusion in free gas and between the walls of pores, and along gradients of temperature (Soret).

J_i = -n D_i^eff grad x_i - S_i^eff x_i grad ln T
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.flow.state import GasState
from mpm.mesh.strip import Strip
from mpm.physics.diffusion import thermal_diffusion
from mpm.physics.mixture import diffusivity_ratio
from mpm.transport.fluxes import FluxAssembler, cell_diffusivity, face_conductance

if TYPE_CHECKING:
    from mpm.case.case import Case


@dataclass(frozen=True, order=True)
class Diffusant:
    """All that decides it: the diffusivity in the gas of the case [m2/s] and, where pores are narrow or Soret counts, the molar mass
    [kg/mol], which is else 0; in a mixture its name, which is else empty. Species that spread alike share their matrices."""

    diffusivity: float
    molar_mass: float
    mixed: str = ""

    @classmethod
    def of(cls, case: Case, species: str) -> Diffusant:
        """That of a species of the case."""
        narrow = any(layer.material and layer.material.pore_diameter for layer in case.geometry.layers)
        heavy = narrow or (case.energy is not None and case.energy.soret)
        mass = case.mechanism.get(species).molar_mass if heavy else 0.0
        return cls(case.gas.diffusivity[species], mass, species if case.gas.mixture else "")

    def assembler(
        self, case: Case, strip: Strip, gas: GasState | None, dispersion: Floats | float
    ) -> FluxAssembler:
        """What builds its flux operators in the state `gas`, or at that of the case; `dispersion` (2, local cells) is added to
        diffusion."""
        if gas is None:
            effective = cell_diffusivity(
                strip, self.diffusivity, self.molar_mass, case.gas.temperature, case.porous.diffusion
            )
            return FluxAssembler(case, strip, effective + dispersion)
        free = self.diffusivity * case.gas.diffusivity_factor(gas.temperature) / gas.pressure
        if self.mixed:
            carrier, species = case.gas, case.mechanism.species
            free = free * diffusivity_ratio(
                self.mixed, species, carrier.carrier, carrier.molar_mass, gas.fractions
            )
        law = case.porous.diffusion
        effective = cell_diffusivity(strip, free, self.molar_mass, gas.temperature, law)
        drift = None
        if case.energy is not None and case.energy.soret:
            drift = self._drift(case, strip, gas, hindered(effective, cell_diffusivity(strip, free, law=law)))
        return FluxAssembler(case, strip, gas.relative * (effective + dispersion), gas.relative, drift)

    def _drift(self, case: Case, strip: Strip, gas: GasState, hindered: Floats) -> Floats:
        """-S^eff grad ln T over the molar density of the case, through the faces inside (faces,) [m/s]: heavy species drift to the cold.

        Molecules that meet walls before they meet others do not separate: the drift is `hindered` (2, local cells) as diffusion is.
        """
        free = thermal_diffusion(self.molar_mass, case.gas.molar_mass, gas.temperature)
        towards_cold = 1.0 if self.molar_mass > case.gas.molar_mass else -1.0
        through = face_conductance(
            strip,
            cell_diffusivity(strip, np.abs(free) / case.gas.molar_density, law=case.porous.diffusion)
            * hindered,
        )
        warmth = np.log(gas.temperature)
        return np.asarray(-towards_cold * through * (warmth[strip.faces.ahead] - warmth[strip.faces.behind]))


def hindered(diffusivity: Floats, free: Floats) -> Floats:
    """Diffusivity over that without walls of pores, 1 where nothing diffuses."""
    return np.divide(diffusivity, free, out=np.ones_like(diffusivity), where=free > 0.0)
