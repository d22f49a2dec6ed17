"""Gas that the ports send through the layers, on paper: how much in all, and how far it spreads below them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mpm.case.gas import Gas
    from mpm.case.geometry import Geometry
    from mpm.case.ports import Inlet


class Throughflow(NamedTuple):
    """Gas that rises through the strip at `velocity` [m/s, superficial, relative to the reactor, at gas.temperature].

    `lag`: by what share of the reactor's own vertical velocity that changes where the inlets stand still in the lab.
    """

    velocity: float
    lag: float


def total_throughflow(geometry: Geometry, gas: Gas) -> Throughflow | None:
    """Inflow of all inlets below over the strip's area, which leaves above; negative where the outlets are below.

    None with outlets on both sides: how gas divides between them follows from the flow. An inlet fixed in the lab, below a reactor that
    moves upwards at V_y, feeds v - V_y.
    """
    sides = {outlet.side for outlet in geometry.outlets}
    if len(sides) > 1:
        return None
    way, from_side = (-1.0, "top") if sides == {"bottom"} else (1.0, "bottom")
    shares = [
        (inlet.width / geometry.length * _expansion(inlet, gas.temperature), inlet)
        for inlet in geometry.inlets
        if inlet.side == from_side
    ]
    return Throughflow(
        way * sum(share * inlet.velocity for share, inlet in shares), sum(share for share, _ in shares)
    )


def _expansion(inlet: Inlet, temperature: float) -> float:
    """Volume of what an inlet blows, once it has the `temperature` of the gas [K], over that at its own."""
    return temperature / (inlet.temperature or temperature)


def flow_resistance(geometry: Geometry, free_path: float) -> float:
    """Sum of h/k_y over the porous layers [1/m]: pressure drop over viscosity and superficial velocity (Darcy).

    `free_path` [m] is that of the gas, which slips in pores of known width.
    """
    return sum(
        layer.height / layer.material.slip_permeability(free_path)[1]
        for layer in geometry.layers
        if layer.material
    )


def spreading_length(geometry: Geometry, free_path: float) -> float:
    """Distance lambda = sqrt(H^3 R / 12) [m] over which gas spreads in the plenum before it enters the porous layers.

    Slot flow under a resistance: q = -(H^3/12 mu) dp/dx in the gas layers below (height H together) and
    u = p/(mu R) through the porous ones give lambda^2 u'' = u - source. Far above the zone length, as in the
    thesis' reactor (3.7 m), the gas rises evenly along the strip whatever the place of the ports.
    """
    height = 0.0
    for layer in geometry.layers:
        if layer.material is not None:
            return math.sqrt(height**3 * flow_resistance(geometry, free_path) / 12.0)
        height += layer.height
    return math.inf


def rising_velocity(geometry: Geometry, gas: Gas, x: float) -> float:
    """Estimated superficial velocity [m/s] at which gas enters the porous layers at position `x`, at gas.temperature.

    Sum over the bottom inlets of the response to a line source with decay length `spreading_length`, in a periodic
    or a closed strip; at most the fastest port velocity.
    """
    length, decay = geometry.length, spreading_length(geometry, gas.mean_free_path)
    inlets = [
        (inlet, inlet.velocity * _expansion(inlet, gas.temperature))
        for inlet in geometry.inlets
        if inlet.side == "bottom"
    ]
    fastest = max((speed for _, speed in inlets), default=0.0)
    total = sum(speed * inlet.width for inlet, speed in inlets)
    if decay == 0.0:
        return fastest
    if decay > 1e3 * length:
        return min(fastest, total / length)
    velocity = 0.0
    for inlet, speed in inlets:
        distance = abs(x - inlet.center)
        images, period = [distance, length - distance], length
        if not geometry.periodic:  # the walls mirror the inlet
            images = [distance, 2 * length - distance, x + inlet.center, 2 * length - x - inlet.center]
            period = 2 * length
        shape = sum(math.exp(-image / decay) for image in images) / -math.expm1(-period / decay)
        velocity += speed * inlet.width * shape / (2.0 * decay)
    return min(fastest, velocity)


def fastest_rise(geometry: Geometry, gas: Gas) -> float:
    """The largest `rising_velocity` [m/s] above an inlet."""
    below = (inlet.center for inlet in geometry.inlets if inlet.side == "bottom")
    return max((rising_velocity(geometry, gas, x) for x in below), default=0.0)
