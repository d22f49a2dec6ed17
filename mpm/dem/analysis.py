"""From the records of several seeds to the numbers and curves of the report."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mpm.physics.conveying import (
    efficiency,
    perfect_flight_velocity,
    straight_drop_velocity,
    throw_number,
)

from .bed import bed_numbers
from .case import DemCase
from .profile import PiecewiseFit, Profile, piecewise_fit
from .spec import BoxSpec
from .waveform import Waveform, extension_velocity, peak_displacement

Arrays = dict[str, np.ndarray]
OPEN_GAP = 0.1  # of the mean diameter: the lowest layers count as lifted above it
LIFTED = 0.25  # the same for the centre of mass, which a bed that only dilates raises by 0.15 (15 layers)
ACCELERATION_DEVIATION = 1.0  # m/s2, the seed's criterion of lift-off (section 3.4.4)


@dataclass(frozen=True)
class Results:
    """Curves over the cycle (n phases), maps over height, per-seed numbers; see the docstrings of the functions."""

    curve: Profile
    base: np.ndarray
    gap: np.ndarray
    rise: np.ndarray
    coordination: np.ndarray
    fit: PiecewiseFit
    seed_velocities: np.ndarray
    cycle_velocities: np.ndarray
    heights: np.ndarray
    solid: np.ndarray
    layer_velocity: np.ndarray
    residence: np.ndarray
    summary: dict[str, Any]


def cycle_velocities(arrays: Arrays, mass: np.ndarray, waveform: Waveform, discard: int) -> np.ndarray:
    """Mean lab-frame velocity of the centre of mass in each kept cycle [m/s]: displacement over duration."""
    centre = arrays["cycle_end"][:, :, 0] @ (mass / mass.sum())
    ends = np.arange(len(centre)) / waveform.frequency
    moved = np.diff(centre + waveform.displacement(ends)[0])
    return moved[discard:] * waveform.frequency


def over_phase(values: np.ndarray, samples: int, discard: int) -> np.ndarray:
    """Samples (cycles * samples, ...) as (kept cycles, samples, ...) from phase 0 on.

    Samples are taken at the ends of equal intervals, so phase 0 of a cycle is the last sample of the one before;
    when no cycle is discarded, the last sample of a cycle stands for its beginning.
    """
    kept = len(values) // samples - discard
    if discard > 0:
        first = discard * samples - 1
        return values[first : first + kept * samples].reshape(kept, samples, *values.shape[1:])
    return np.roll(values.reshape(kept, samples, *values.shape[1:]), 1, axis=1)


def gap_over_phase(arrays: Arrays, samples: int, discard: int) -> np.ndarray:
    """Rise of the lowest layers above their lowest position in each kept cycle [m], (kept cycles, samples)."""
    height = over_phase(arrays["gap_height"], samples, discard)
    return height - height.min(axis=1, keepdims=True)


def rise_over_phase(arrays: Arrays, samples: int, discard: int) -> np.ndarray:
    """Rise of the centre of mass above its lowest position in each kept cycle [m], (kept cycles, samples)."""
    edges = arrays["edges"]
    centres = 0.5 * (edges[1:] + edges[:-1])
    solid = over_phase(arrays["solid"], samples, discard)
    height = solid @ centres / solid.sum(axis=-1)
    return height - height.min(axis=1, keepdims=True)


def flight_interval(phase: np.ndarray, gap: np.ndarray, limit: float) -> tuple[float, float] | None:
    """(lift-off, contact) phases [deg] of the longest interval in which gap or rise stay above `limit`, or None.

    Crossings are interpolated linearly; the cycle is closed. None also when the gap never closes.
    """
    n = len(phase)
    above = gap > limit
    if not above.any() or above.all():
        return None
    best, run, start = 0, 0, 0
    for i in range(2 * n):
        run = run + 1 if above[i % n] else 0
        if run > best and run < n:
            best, start = run, i - run + 1
    step = 360.0 / n

    def crossing(i: int) -> float:
        low, high = gap[i % n], gap[(i + 1) % n]
        return float((i + (limit - low) / (high - low)) * step % 360.0)

    return crossing(start - 1), crossing(start + best - 1)


def acceleration_liftoff(curve: Profile, base: np.ndarray, period: float) -> tuple[float, float] | None:
    """The seed's criterion: (phase [deg], delay after mid-extension [s]) at which |d(u_bed - u_base)/dt| first
    exceeds 1 m/s2 in two successive samples, after the largest base velocity.

    The search begins where the bed follows the base (velocity within a tenth of the largest, acceleration within
    the criterion, over three samples): a bed may land only after mid-extension. None when it never follows it in
    the half cycle after mid-extension, as a slipping bed, or never deviates.
    """
    relative = curve.velocity[0] - base[0]
    n = len(relative)
    start = int(np.argmax(base[0]))
    rate = np.roll(np.roll(relative, -1) - np.roll(relative, 1), -start) / (2.0 * period / n)
    calm = np.abs(rate) <= ACCELERATION_DEVIATION
    follows = calm & (np.abs(np.roll(relative, -start)) < 0.1 * base[0, start])
    together = np.flatnonzero(
        follows[: n // 2] & np.roll(follows, -1)[: n // 2] & np.roll(follows, -2)[: n // 2]
    )
    if len(together) == 0:
        return None
    deviates = np.flatnonzero(~calm & ~np.roll(calm, -1))
    deviates = deviates[deviates > together[0]]
    if len(deviates) == 0:
        return None
    k = int(deviates[0])
    return float(curve.phase[(start + k) % n]), k * period / n


def self_diffusivity(arrays: Arrays, discard: int, period: float, cycles: int = 1) -> np.ndarray:
    """D_ij = <(dx_i - <dx_i>)(dx_j - <dx_j>)>/(2 dt) [m2/s], shape (3, 3), with dt a whole number of cycles.

    Axes x (along the base), y (across), z (normal). The seed takes dt = one DEM time step; the motion is then
    ballistic and D = <u'^2> dt/2 counts the time step. Over whole cycles the vibration itself drops out.
    """
    ends = arrays["cycle_end"][discard:]
    if len(ends) <= cycles:
        cycles = len(ends) - 1
    moved = ends[cycles:] - ends[:-cycles]
    moved = (moved - moved.mean(axis=1, keepdims=True)).reshape(-1, 3)
    return moved.T @ moved / len(moved) / (2.0 * cycles * period)


def residence_times(arrays: Arrays, discard: int, waveform: Waveform, length: float) -> np.ndarray:
    """Time each particle needs for `length` at its mean speed over the kept cycles [s]; inf when it does not advance."""
    ends = arrays["cycle_end"][discard:, :, 0]
    kept = len(ends) - 1
    carried = np.diff(waveform.displacement(np.array([discard, discard + kept]) / waveform.frequency)[0])
    speed = (ends[-1] - ends[0] + carried) * waveform.frequency / kept
    return np.divide(length, speed, out=np.full_like(speed, np.inf), where=speed > 1e-9)


def analyse(case: DemCase, spec: BoxSpec, masses: list[np.ndarray], records: list[Arrays]) -> Results:
    """All results of the seeds of one powder file; `masses` of the particles per seed (the sizes are shuffled)."""
    waveform, run = case.build_waveform(), case.run
    samples, discard, period = run.samples_per_cycle, run.discard, 1.0 / waveform.frequency
    phase = np.arange(samples) * 360.0 / samples
    times = np.arange(samples) / samples * period

    def mean_over(name: str) -> np.ndarray:
        return np.mean([over_phase(r[name], samples, discard).mean(axis=0) for r in records], axis=0)

    cycles = np.array(
        [cycle_velocities(r, m, waveform, discard) for r, m in zip(records, masses, strict=True)]
    )
    gaps = np.concatenate([gap_over_phase(r, samples, discard) for r in records])
    rises = np.concatenate([rise_over_phase(r, samples, discard) for r in records])
    contact = (rises <= LIFTED * spec.powder.diameter).mean(axis=0)
    curve = Profile(phase, mean_over("velocity").T, contact)
    base = waveform.velocity(times)
    residence = np.concatenate(
        [residence_times(r, discard, waveform, case.profile.residence_length) for r in records]
    )
    edges = records[0]["edges"]
    # boxes of different seeds differ in height by a bin or two
    bins = min(len(r["edges"]) for r in records) - 1
    solid = np.mean(
        [over_phase(r["solid"][:, :bins], samples, discard).mean(axis=0) for r in records], axis=0
    )
    layers = np.mean([_layer_means(r, bins, samples, discard) for r in records], axis=0)
    results = Results(
        curve=curve,
        base=base,
        gap=gaps.mean(axis=0),
        rise=rises.mean(axis=0),
        coordination=2.0 * mean_over("pairs"),
        fit=piecewise_fit(curve, base),
        seed_velocities=cycles.mean(axis=1),
        cycle_velocities=cycles,
        heights=0.5 * (edges[1 : bins + 1] + edges[:bins]),
        solid=solid,
        layer_velocity=layers,
        residence=residence,
        summary={},
    )
    results.summary.update(_summary(case, spec, waveform, results, records))
    return results


def _layer_means(record: Arrays, bins: int, samples: int, discard: int) -> np.ndarray:
    """Velocity along the base per height bin, weighted with what the bin holds [m/s]; 0 where it stays empty."""
    solid = over_phase(record["solid"][:, :bins], samples, discard)
    carried = (over_phase(record["layer_velocity"][:, :bins], samples, discard) * solid).sum(axis=(0, 1))
    weight = solid.sum(axis=(0, 1))
    return np.divide(carried, weight, out=np.zeros(bins), where=weight > 0.0)


def _summary(
    case: DemCase, spec: BoxSpec, waveform: Waveform, results: Results, records: list[Arrays]
) -> dict[str, Any]:
    run, powder, period = case.run, spec.powder, 1.0 / waveform.frequency
    seeds = results.seed_velocities
    mean = float(seeds.mean())
    bulk = flight_interval(results.curve.phase, results.rise, LIFTED * powder.diameter)
    layers = flight_interval(results.curve.phase, results.gap, OPEN_GAP * powder.diameter)
    criterion = acceleration_liftoff(results.curve, results.base, period)
    x, _ = peak_displacement(waveform)
    downward = -float(waveform.acceleration(np.linspace(0.0, period, 4097))[1].min())
    d_one = np.mean([self_diffusivity(r, run.discard, period) for r in records], axis=0)
    kept = run.cycles - run.discard
    d_long = np.mean([self_diffusivity(r, run.discard, period, kept) for r in records], axis=0)
    spread = np.mean(
        [r["spread"][run.discard * run.samples_per_cycle :].mean(axis=0) for r in records], axis=0
    )
    finite = results.residence[np.isfinite(results.residence)]
    flying = results.curve.contact < 0.5
    retracting = results.base[0] < 0.0
    pairs = results.coordination
    on_base = np.mean([r["on_base"][run.discard * run.samples_per_cycle :].mean() for r in records])
    return {
        "mean_velocity": {
            "mean": mean,
            "spread": float(seeds.std(ddof=1)) if len(seeds) > 1 else None,
            "standard_error": float(seeds.std(ddof=1) / np.sqrt(len(seeds))) if len(seeds) > 1 else None,
            "seeds": seeds.tolist(),
            "spread_of_cycles": float(results.cycle_velocities.std()),
        },
        "efficiency": efficiency(mean, extension_velocity(waveform)),
        "limits": {
            "straight_drop": straight_drop_velocity(x, waveform.frequency),
            "perfect_flight": extension_velocity(waveform),
            "perfect_flight_of_a_sine": perfect_flight_velocity(x, waveform.frequency),
            "throw_number": throw_number(downward, case.box.declination),
            "gamma": throw_number(downward),
        },
        "liftoff": {
            "phase_deg": bulk[0] if bulk else None,
            "contact_phase_deg": bulk[1] if bulk else None,
            "lowest_layers_phase_deg": layers[0] if layers else None,
            "lowest_layers_contact_phase_deg": layers[1] if layers else None,
            "flight_share": float((results.curve.contact < 0.5).mean()),
            "largest_rise": float(results.rise.max()),
            "largest_gap": float(results.gap.max()),
            "acceleration_phase_deg": criterion[0] if criterion else None,
            "acceleration_delay": criterion[1] if criterion else None,
        },
        "coordination": {
            "contacts_per_particle": float(pairs.mean()),
            "in_contact": float(pairs[~flying].mean()) if (~flying).any() else None,
            "in_flight": float(pairs[flying].mean()) if flying.any() else None,
            "in_retraction": float(pairs[retracting].mean()) if retracting.any() else None,
            "seed_definition": float(pairs.mean() / 4.0),
            "share_on_base": float(on_base),
        },
        "self_diffusivity": {
            "one_cycle": {"xx": d_one[0, 0], "yy": d_one[2, 2], "across": d_one[1, 1]},
            "all_cycles": {"xx": d_long[0, 0], "yy": d_long[2, 2], "across": d_long[1, 1]},
            "velocity_variance": {"xx": spread[0], "yy": spread[2], "across": spread[1]},
        },
        "residence": {
            "length": case.profile.residence_length,
            "mean": float(finite.mean()) if len(finite) else None,
            "standard_deviation": float(finite.std()) if len(finite) else None,
            "median": float(np.median(results.residence)) if np.isfinite(np.median(results.residence)) else None,
            "share_not_advancing": float(1.0 - len(finite) / len(results.residence)),
        },
        "bed": bed_numbers(case, spec, results.heights, results.solid),
        "fit": {
            "liftoff_deg": results.fit.liftoff,
            "contact_deg": results.fit.contact,
            "flight_velocity": float(results.fit.flight[0]),
            "rms": results.fit.rms,
        },
    }  # fmt: skip
