"""How the bed of a case moves under its own forces, as numbers; nothing for a bed whose motion is prescribed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpm.report.quantity import RATIO, Quantity

if TYPE_CHECKING:
    from mpm.case.case import Case


BED_MOTION = (
    Quantity("motion.bed_velocity", "mean velocity of the bed under its forces", "m/s",
        "mean over the cycle, relative to the reactor, negative to the left (profile force_balance)", "cm/s"),
    Quantity("motion.through_velocity", "gas that rises through the bed", "m/s",
        "superficial velocity relative to the reactor with which the balance of forces is drawn up", "cm/s"),
    Quantity("motion.gas_share", "share of the bed's weight that gas carries", RATIO,
        "drag of the rising gas over the weight; 1: fluidised"),
    Quantity("motion.weight", "weight of the bed", "Pa", "mass of its solids times g, per area"),
    Quantity("motion.contact_force_min", "smallest contact force", "Pa",
        "between the bed and what it lies on, per area; 0 in flight, negative where adhesion holds it"),
    Quantity("motion.contact_force_max", "largest contact force", "Pa", "the same, without the impulses of landings"),
    Quantity("motion.gap", "largest gap below the bed", "m", "height to which the bed lifts off in a cycle; 0: it never does", "um"),
    Quantity("motion.stick_share", "share of the cycle in which the bed sticks", RATIO, "it moves with the reactor"),
    Quantity("motion.slide_share", "share of the cycle in which the bed slides", RATIO, "in contact, ahead of or behind the reactor"),
    Quantity("motion.flight_share", "share of the cycle in which the bed flies", RATIO, "without contact"),
    Quantity("motion.liftoff_phase", "phase of lift-off", "rad",
        "counted from where the reactor passes its mean position upwards; of the first flight in a cycle", "deg"),
    Quantity("motion.landing_phase", "phase of landing", "rad", "at the end of that flight", "deg"),
)  # fmt: skip
"""Their entries in the table of reported numbers (`mpm.report.quantities`)."""


def bed_motion(case: Case) -> dict[str, float]:
    """Speed, gas, gap, forces and phases of one cycle (`mpm.physics.bed_cycle`); phases of the first flight where there are several."""
    cycle = case.motion.balance
    if cycle is None:
        return {}
    forces, (least, most) = cycle.forces, cycle.contact_range
    numbers = {
        "bed_velocity": cycle.mean,
        "through_velocity": forces.through_flow,
        "gas_share": forces.gas_share,
        "weight": forces.weight,
        "contact_force_min": least,
        "contact_force_max": most,
        "gap": cycle.largest_gap,
        "stick_share": cycle.share("stick"),
        "slide_share": cycle.share("slide"),
        "flight_share": cycle.share("flight"),
    }
    if cycle.flights:
        numbers["liftoff_phase"], numbers["landing_phase"] = cycle.flights[0]
    return numbers
