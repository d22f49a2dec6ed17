"""What `mpm check` says of the motion: amplitudes, limits of conveying, what forces make of the bed, what a prescribed flight takes."""

from __future__ import annotations

import math
from typing import Any

from mpm.case.balance import forces_on_bed
from mpm.case.case import Case
from mpm.case.marks import Marked
from mpm.case.throughflow import rising_velocity
from mpm.constants import TURN
from mpm.motion.kinematics import BedMotion, Flight, Vibration
from mpm.physics.conveying import perfect_flight_velocity, straight_drop_velocity
from mpm.report.bed_motion import bed_motion
from mpm.report.verdict import percent
from mpm.screen import Sheet, number


def motion_report(case: Case) -> dict[str, Any]:
    """The table `motion` of the report of `mpm check`, SI."""
    motion, vibration = case.motion, Vibration.from_motion(case.motion)
    numbers: dict[str, Any] = {
        "gamma": motion.gamma,
        "vibration_enters": case.follows_cycle and motion.gamma > 0.0,
        "frequency": motion.frequency,
        "amplitude_x": vibration.ax,
        "amplitude_y": vibration.ay,
        "peak_velocity_x": vibration.ax * vibration.omega,
        "peak_velocity_y": vibration.ay * vibration.omega,
        "straight_drop": straight_drop_velocity(vibration.ax, motion.frequency),
        "perfect_flight": perfect_flight_velocity(vibration.ax, motion.frequency),
        "bed_velocity": motion.mean_velocity,
        "bed_velocity_from": _source(case),
    }
    if motion.balance is not None:
        numbers |= bed_motion(case)
        numbers["phases"] = [
            {"kind": s.kind, "from": s.start, "to": s.stop}
            for s in motion.balance.segments
            if s.stop > s.start
        ]
        numbers["rising_velocity"] = {
            inlet.name: rising_velocity(case.geometry, case.gas, inlet.center)
            for inlet in case.geometry.inlets
            if inlet.side == "bottom"
        }
    force = flight_force(case)
    if force is not None:
        numbers |= {"flight_force_min": force[0], "flight_force_max": force[1]}
    return numbers


def force_rows(sheet: Sheet, motion: dict[str, Any], marked: Marked) -> None:
    """What forces make of the bed, on the screen of `mpm check`; nothing where they do not decide."""
    if "phases" not in motion:
        return
    sheet.add("friction", marked.text("motion.friction"), part=True)
    for key in ("adhesion", "gas_column"):
        sheet.add(key.replace("_", " "), marked.text(f"motion.{key}"), part=True)
    sheet.add(
        "gas rising through the bed",
        f"{number(motion['through_velocity'] * 1e2, 'cm/s')}, which by its permeability carries "
        f"{percent(motion['gas_share'])} of its weight, {number(motion['weight'], 'Pa', 3)}",
        part=True,
    )
    for name, velocity in motion["rising_velocity"].items():
        sheet.add(f"gas rising above {name}", number(velocity * 1e2, "cm/s"), part=True)
    sheet.add("phases of its cycle", "from where the reactor passes its mean position upwards", part=True)
    for phase in motion["phases"]:
        start, stop = (math.degrees(phase[key]) for key in ("from", "to"))
        word = {"stick": "moves with the reactor", "slide": "slides", "flight": "flies"}[phase["kind"]]
        sheet.add(f"it {word}", f"from {number(start)} to {number(stop, 'deg')}", part=True)
    forces = (
        f"{number(motion['contact_force_min'], digits=3)} to {number(motion['contact_force_max'], 'Pa', 3)}"
    )
    sheet.add("contact force", forces, part=True)
    sheet.add("largest gap", number(motion["gap"] * 1e6, "um", 3), part=True)


def _source(case: Case) -> str:
    motion = case.motion
    if motion.balances:
        return "the balance of forces"
    return "motion.bed_velocity" if motion.table is None else f"mean of {motion.profile}"


def flight_force(case: Case) -> tuple[float, float] | None:
    """Smallest and largest force of gas on the bed [Pa] in the flight that a profile prescribes; None for other profiles.

    The preset flies at constant velocity, vertically at that which joins the reactor's positions at lift-off and landing, V_l. Gas then
    drags at it by R (U(t) - (V_l - V_y(t))), with the reactor's vertical velocity V_y and R, U as in `mpm.physics.bed_forces`. A flight
    at constant velocity needs the weight, always. None too where the density of the bed is not known.
    """
    forces, course = forces_on_bed(case.motion, case.geometry, case.gas), None
    if forces is not None and case.motion.gamma > 0.0:
        course = BedMotion(case.motion).course
    if forces is None or not isinstance(course, Flight):
        return None
    start, length = course.liftoff, (course.contact - course.liftoff) % TURN
    stop, peak = start + length, forces.ay * forces.omega
    velocity = peak * (math.sin(stop) - math.sin(start)) / length
    swing = [math.cos(start), math.cos(stop)]  # V_y over its peak, at the ends and at its turns between them
    swing += [(-1.0) ** n for n in range(math.ceil(start / math.pi), math.floor(stop / math.pi) + 1)]
    pull = [
        forces.resistance * (forces.through_flow + (1.0 - forces.lag) * peak * c - velocity) for c in swing
    ]
    return min(pull), max(pull)


def flight_caveats(case: Case) -> list[str]:
    """Whether the flight that a profile prescribes takes more force of the gas than the bed weighs, in a run that follows the cycle."""
    forces, pull = forces_on_bed(case.motion, case.geometry, case.gas), flight_force(case)
    if forces is None or pull is None or not case.follows_cycle or max(map(abs, pull)) <= forces.weight:
        return []
    least, most = (f"{force:.3g}" for force in pull)
    return [
        f"the flight of motion.profile = {case.motion.profile} would take {least} to {most} Pa of gas force on a bed that weighs "
        f"{forces.weight:.3g} Pa (force_balance moves it as forces do)"
    ]
