"""The numbers of summary.json that come from the records of a powder file's seeds, table by table."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.physics.conveying import (
    efficiency,
    perfect_flight_velocity,
    straight_drop_velocity,
    throw_number,
)

from .analysis import Results
from .bed import bed_numbers
from .case import DemCase
from .liftoff import LIFTED, OPEN_GAP, acceleration_liftoff, flight_interval
from .sampling import Arrays
from .spec import BoxSpec
from .tables import RunInput
from .waveform import Waveform, extension_velocity, peak_displacement

Numbers = dict[str, Any]
"""By name; None for what cannot be computed."""


def summarise(case: DemCase, spec: BoxSpec, results: Results, records: list[Arrays]) -> Numbers:
    """All of them. SI."""
    waveform = case.build_waveform()
    return {
        "mean_velocity": mean_velocity(results),
        "efficiency": efficiency(float(results.seed_velocities.mean()), extension_velocity(waveform)),
        "limits": limits(waveform, case.box.declination),
        "liftoff": liftoff(results, spec.powder.diameter, 1.0 / waveform.frequency),
        "coordination": coordination(results, case.run, records),
        "self_diffusivity": self_diffusion(case.run, records, 1.0 / waveform.frequency),
        "residence": residence(results, case.profile.residence_length),
        "bed": bed_numbers(case, spec, results.heights, results.solid),
        "fit": {
            "liftoff_deg": results.fit.liftoff,
            "contact_deg": results.fit.contact,
            "flight_velocity": float(results.fit.flight[0]),
            "rms": results.fit.rms,
        },
    }


def mean_velocity(results: Results) -> Numbers:
    """Velocity of the bed along the base, and how far seeds and cycles lie apart [m/s]."""
    seeds = results.seed_velocities
    several = len(seeds) > 1
    return {
        "mean": float(seeds.mean()),
        "spread": float(seeds.std(ddof=1)) if several else None,
        "standard_error": float(seeds.std(ddof=1) / np.sqrt(len(seeds))) if several else None,
        "seeds": seeds.tolist(),
        "spread_of_cycles": float(results.cycle_velocities.std()),
    }


def limits(waveform: Waveform, declination: float) -> Numbers:
    """What the motion of the base allows: velocities [m/s], and accelerations over gravity."""
    x, _ = peak_displacement(waveform)
    downward = -float(waveform.acceleration(np.linspace(0.0, 1.0 / waveform.frequency, 4097))[1].min())
    return {
        "straight_drop": straight_drop_velocity(x, waveform.frequency),
        "perfect_flight": extension_velocity(waveform),
        "perfect_flight_of_a_sine": perfect_flight_velocity(x, waveform.frequency),
        "throw_number": throw_number(downward, declination),
        "gamma": throw_number(downward),
    }


def liftoff(results: Results, diameter: float, period: float) -> Numbers:
    """Phases of flight [deg] of centre of mass and lowest layers, how far they rise [m], and the seed's criterion."""
    phase = results.curve.phase
    bulk = flight_interval(phase, results.rise, LIFTED * diameter)
    layers = flight_interval(phase, results.gap, OPEN_GAP * diameter)
    criterion = acceleration_liftoff(results.curve, results.base, period)
    return {
        "phase_deg": bulk[0] if bulk else None,
        "contact_phase_deg": bulk[1] if bulk else None,
        "lowest_layers_phase_deg": layers[0] if layers else None,
        "lowest_layers_contact_phase_deg": layers[1] if layers else None,
        "flight_share": float((results.curve.contact < 0.5).mean()),
        "largest_rise": float(results.rise.max()),
        "largest_gap": float(results.gap.max()),
        "acceleration_phase_deg": criterion[0] if criterion else None,
        "acceleration_delay": criterion[1] if criterion else None,
    }


def coordination(results: Results, run: RunInput, records: list[Arrays]) -> Numbers:
    """Contacts per particle over the cycle and in parts of it; the seed counts a quarter of them."""
    pairs = results.coordination
    flying, retracting = results.curve.contact < 0.5, results.base[0] < 0.0

    def mean(where: NDArray[np.bool_]) -> float | None:
        return float(pairs[where].mean()) if where.any() else None

    on_base = [r["on_base"][run.discard * run.samples_per_cycle :].mean() for r in records]
    return {
        "contacts_per_particle": float(pairs.mean()),
        "in_contact": mean(~flying),
        "in_flight": mean(flying),
        "in_retraction": mean(retracting),
        "seed_definition": float(pairs.mean() / 4.0),
        "share_on_base": float(np.mean(on_base)),
    }


def self_diffusion(run: RunInput, records: list[Arrays], period: float) -> Numbers:
    """Self-diffusivity [m2/s] from displacements in one cycle and in all of them; variances of the particles' velocities [m2/s2]."""

    def over(cycles: int) -> Numbers:
        d = np.mean([self_diffusivity(r, run.discard, period, cycles) for r in records], axis=0)
        return {"xx": d[0, 0], "yy": d[2, 2], "across": d[1, 1]}

    first = run.discard * run.samples_per_cycle
    variance = np.mean([r["spread"][first:].mean(axis=0) for r in records], axis=0)
    return {
        "one_cycle": over(1),
        "all_cycles": over(run.cycles - run.discard),
        "velocity_variance": {"xx": variance[0], "yy": variance[2], "across": variance[1]},
    }


def self_diffusivity(arrays: Arrays, discard: int, period: float, cycles: int = 1) -> Floats:
    """D_ij = <(dx_i - <dx_i>)(dx_j - <dx_j>)>/(2 dt) [m2/s], shape (3, 3), with dt a whole number of cycles.

    Axes x (along the base), y (across), z (normal). The seed takes dt = one DEM time step; the motion is then
    ballistic and D = <u'^2> dt/2 counts the time step. Over whole cycles the vibration itself drops out.
    """
    ends = arrays["cycle_end"][discard:]
    if len(ends) <= cycles:
        cycles = len(ends) - 1
    moved = ends[cycles:] - ends[:-cycles]
    moved = (moved - moved.mean(axis=1, keepdims=True)).reshape(-1, 3)
    tensor: Floats = moved.T @ moved / len(moved) / (2.0 * cycles * period)
    return tensor


def residence(results: Results, length: float) -> Numbers:
    """Times [s] that particles need for `length` [m], of those that advance; the median is that of all."""
    times = results.residence
    finite, median = times[np.isfinite(times)], float(np.median(times))
    return {
        "length": length,
        "mean": float(finite.mean()) if len(finite) else None,
        "standard_deviation": float(finite.std()) if len(finite) else None,
        "median": median if np.isfinite(median) else None,
        "share_not_advancing": float(1.0 - len(finite) / len(times)),
    }
