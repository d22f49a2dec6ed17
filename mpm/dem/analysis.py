"""From the records of several seeds to curves over the cycle, maps over height and numbers of each seed."""

from dataclasses import dataclass

import numpy as np

from mpm.arrays import Floats

from .case import DemCase
from .liftoff import LIFTED
from .profile import PiecewiseFit, Profile, piecewise_fit
from .sampling import Arrays
from .spec import BoxSpec
from .waveform import Waveform


@dataclass(frozen=True, kw_only=True)
class Results:
    """Curves over the cycle (n phases), maps over height, per-seed numbers; see the docstrings of the functions."""

    curve: Profile
    base: Floats
    gap: Floats
    rise: Floats
    coordination: Floats
    fit: PiecewiseFit
    seed_velocities: Floats
    cycle_velocities: Floats
    heights: Floats
    solid: Floats
    layer_velocity: Floats
    residence: Floats


def cycle_velocities(arrays: Arrays, mass: Floats, waveform: Waveform, discard: int) -> Floats:
    """Mean lab-frame velocity of the centre of mass in each kept cycle [m/s]: displacement over duration."""
    centre = arrays["cycle_end"][:, :, 0] @ (mass / mass.sum())
    ends = np.arange(len(centre)) / waveform.frequency
    moved: Floats = np.diff(centre + waveform.displacement(ends)[0]) * waveform.frequency
    return moved[discard:]


def over_phase(values: Floats, samples: int, discard: int) -> Floats:
    """Samples (cycles * samples, ...) as (kept cycles, samples, ...) from phase 0 on.

    Samples are taken at the ends of equal intervals, so phase 0 of a cycle is the last sample of the one before;
    when no cycle is discarded, the last sample of a cycle stands for its beginning.
    """
    kept = len(values) // samples - discard
    if discard > 0:
        first = discard * samples - 1
        return values[first : first + kept * samples].reshape(kept, samples, *values.shape[1:])
    return np.roll(values.reshape(kept, samples, *values.shape[1:]), 1, axis=1)


def gap_over_phase(arrays: Arrays, samples: int, discard: int) -> Floats:
    """Rise of the lowest layers above their lowest position in each kept cycle [m], (kept cycles, samples)."""
    height = over_phase(arrays["gap_height"], samples, discard)
    return height - height.min(axis=1, keepdims=True)


def rise_over_phase(arrays: Arrays, samples: int, discard: int) -> Floats:
    """Rise of the centre of mass above its lowest position in each kept cycle [m], (kept cycles, samples)."""
    edges = arrays["edges"]
    centres = 0.5 * (edges[1:] + edges[:-1])
    solid = over_phase(arrays["solid"], samples, discard)
    height = solid @ centres / solid.sum(axis=-1)
    return height - height.min(axis=1, keepdims=True)


def residence_times(arrays: Arrays, discard: int, waveform: Waveform, length: float) -> Floats:
    """Time each particle needs for `length` at its mean speed over the kept cycles [s]; inf when it does not advance."""
    ends = arrays["cycle_end"][discard:, :, 0]
    kept = len(ends) - 1
    carried = np.diff(waveform.displacement(np.array([discard, discard + kept]) / waveform.frequency)[0])
    speed: Floats = (ends[-1] - ends[0] + carried) * waveform.frequency / kept
    return np.divide(length, speed, out=np.full_like(speed, np.inf), where=speed > 1e-9)


def analyse(case: DemCase, spec: BoxSpec, masses: list[Floats], records: list[Arrays]) -> Results:
    """All results of the seeds of one powder file; `masses` of the particles per seed (the sizes are shuffled)."""
    waveform, run = case.build_waveform(), case.run
    samples, discard, period = run.samples_per_cycle, run.discard, 1.0 / waveform.frequency
    phase = np.arange(samples) * 360.0 / samples
    times = np.arange(samples) / samples * period

    def mean_over(name: str) -> Floats:
        return np.mean([over_phase(r[name], samples, discard).mean(axis=0) for r in records], axis=0)

    cycles = np.array(
        [cycle_velocities(r, m, waveform, discard) for r, m in zip(records, masses, strict=True)]
    )
    gaps = np.concatenate([gap_over_phase(r, samples, discard) for r in records])
    rises = np.concatenate([rise_over_phase(r, samples, discard) for r in records])
    contact = (rises <= LIFTED * spec.powder.diameter).mean(axis=0)
    curve = Profile(phase=phase, velocity=mean_over("velocity").T, contact=contact)
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
    layers = np.mean([_layer_means(r, bins=bins, samples=samples, discard=discard) for r in records], axis=0)
    return Results(
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
    )


def _layer_means(record: Arrays, *, bins: int, samples: int, discard: int) -> Floats:
    """Velocity along the base per height bin, weighted with what the bin holds [m/s]; 0 where it stays empty."""
    solid = over_phase(record["solid"][:, :bins], samples, discard)
    carried = (over_phase(record["layer_velocity"][:, :bins], samples, discard) * solid).sum(axis=(0, 1))
    weight = solid.sum(axis=(0, 1))
    return np.divide(carried, weight, out=np.zeros(bins), where=weight > 0.0)
