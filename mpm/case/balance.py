"""The forces on the bed of a case, and the motion they make: what `motion.profile = "force_balance"` stands for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm.case.throughflow import Throughflow, fastest_rise, total_throughflow
from mpm.physics.bed_balance import LONGEST_FLIGHT
from mpm.physics.bed_cycle import NoCycle, bed_cycle
from mpm.physics.bed_forces import BedForces, Carried
from mpm.units import reject

if TYPE_CHECKING:
    from mpm.case.gas import Gas
    from mpm.case.geometry import Geometry
    from mpm.case.motion import Motion


def forces_on_bed(motion: Motion, geometry: Geometry, gas: Gas) -> BedForces | None:
    """What acts on the moving layer, with gas as it is at gas.temperature; None where no layer moves or its density is not known.

    Per area: m = rho_s (1 - eps) h and R = mu h/K_y, with the permeability that slip leaves. Where the case cannot tell how much gas passes
    the bed (`through_flow`), none does.
    """
    layer = geometry.moving_layer
    material = None if layer is None else layer.material
    if layer is None or material is None or material.density is None:
        return None
    flow = through_flow(motion, geometry, gas) or Throughflow(0.0, 0.0)
    ax, ay, omega = motion.amplitudes
    return BedForces(
        mass=material.density * (1.0 - material.porosity) * layer.height,
        resistance=gas.viscosity * layer.height / material.slip_permeability(gas.mean_free_path)[1],
        through_flow=flow.velocity,
        lag=flow.lag,
        friction=motion.friction,
        adhesion=motion.adhesion,
        ax=ax,
        ay=ay,
        omega=omega,
    )


def through_flow(motion: Motion, geometry: Geometry, gas: Gas) -> Throughflow | None:
    """Gas through the bed, and how much of the reactor's vertical velocity it lags behind; None where the ports do not tell.

    Beside a prescribed motion, of which forces are only told, it is what the ports send: the keys that say otherwise are without effect.
    """
    ports, decides = total_throughflow(geometry, gas), motion.balances
    velocity = motion.through_velocity if decides else None
    if velocity is None and ports is not None:
        local = decides and motion.through_flow == "local" and ports.velocity > 0.0
        velocity = fastest_rise(geometry, gas) if local else ports.velocity
    if velocity is None:
        return None
    if decides and motion.gas_column == "lab":
        return Throughflow(velocity, 1.0)
    moves = motion.inlet_frame == "lab" and ports is not None
    return Throughflow(velocity, ports.lag if moves and ports is not None else 0.0)


def complete_motion(motion: Motion, geometry: Geometry, gas: Gas) -> None:
    """Work out how the bed moves where its forces decide; the case does this once its tables are read."""
    if not motion.balances:
        return
    layer = geometry.moving_layer
    if layer is None:
        raise reject(
            "force_balance, and no layer that moves",
            "another profile, or moving = true in a layer",
            key="motion.profile",
        )
    if layer.solid.density is None:
        raise reject(
            "nothing, which leaves the weight of the bed open",
            'a density of the solid, e.g. "2500 kg/m^3", for motion.profile = "force_balance"',
            key=f"material.{layer.material_name}.density",
        )
    shaken = motion.gamma > 0.0
    if shaken and motion.through_velocity is None and total_throughflow(geometry, gas) is None:
        raise reject(
            "nothing, and outlets on both sides of the bed, where the ports do not tell how much gas rises through it",
            'a superficial velocity, e.g. "0.2 cm/s", for motion.profile = "force_balance"',
            key="motion.through_velocity",
        )
    forces = forces_on_bed(motion, geometry, gas)
    if forces is None or not shaken:
        return
    try:
        motion.complete(bed_cycle(forces))
    except Carried:
        if forces.gas_share < 1.0:
            raise reject(
                f"force_balance at gamma = {motion.gamma:g}: the bed does not come down within {LONGEST_FLIGHT} cycles",
                "a smaller gamma, or another profile",
                key="motion.profile",
            ) from None
        rising, share = forces.through_flow * 100.0, forces.gas_share
        raise reject(
            f"force_balance with {rising:.3g} cm/s of gas through the bed, {share:.3g} times what carries it: it floats away",
            f"less gas (minimum fluidisation is at {rising / share:.3g} cm/s), or another profile",
            key="motion.profile",
        ) from None
    except NoCycle:
        raise reject(
            f"force_balance at gamma = {motion.gamma:g}: no cycle of the bed is like the one before",
            "a smaller gamma, or another profile",
            key="motion.profile",
        ) from None
