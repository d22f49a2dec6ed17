"""Which kinetics a mechanism needs: the closed forms for one gas that meets one site (or another gas), or those for any law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from mpm.arrays import Floats
from mpm.physics.general_gas import GeneralGas
from mpm.physics.general_kinetics import GeneralKinetics
from mpm.physics.kinetics import GasKinetics, SurfaceKinetics

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism

Surface = SurfaceKinetics | GeneralKinetics
Gas = GasKinetics | GeneralGas


def surface_kinetics(
    mechanism: Mechanism, coupled: Sequence[str], sites: Floats, temperature: ArrayLike
) -> Surface:
    """Surface reactions in cells with `sites` n_s (n,) [mol/m2] among the `coupled` gases at `temperature` [K]."""
    if mechanism.is_first_order:
        return SurfaceKinetics(mechanism, tuple(coupled), sites, temperature)
    return GeneralKinetics(mechanism, coupled, sites, temperature)


def gas_kinetics(mechanism: Mechanism, coupled: Sequence[str], cells: int, temperature: ArrayLike) -> Gas:
    """Gas reactions in so many `cells` among the `coupled` gases at `temperature` [K]."""
    if all(reaction.is_second_order for reaction in mechanism.gas_reactions):
        return GasKinetics(mechanism, tuple(coupled), temperature)
    return GeneralGas(mechanism, coupled, cells, temperature)
