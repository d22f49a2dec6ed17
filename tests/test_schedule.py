"""The grid of steps: aligned with cycle and columns, cut at the end."""

from itertools import pairwise

import pytest

from mpm.motion.schedule import RESTING, Schedule, aligned_step

from .cases import SHORT, TINY, strip_case, zone

SCHEDULES = {
    "whole steps": Schedule(dt=0.01, phases=1, start=0.05, end=1.0),
    "cut step": Schedule(dt=0.014, phases=1, start=0.05, end=1.0),
    "a step longer than the run": Schedule(dt=3.0, phases=1, start=0.0, end=1.0),
    "phases": Schedule(dt=1 / 16 / 32, phases=32, start=0.05, end=1.0),
    "ends at rest": Schedule(dt=0.014, phases=1, start=0.5, end=0.2),
    "ends with the rest": Schedule(dt=0.014, phases=1, start=0.5, end=0.5),
}


@pytest.mark.parametrize("name", SCHEDULES)
def test_steps_fill_the_time_to_its_end(name: str) -> None:
    """Fails when the steps leave a gap, do not end at the end to the last digit, or another than the last is cut."""
    schedule = SCHEDULES[name]
    steps = list(schedule.from_step(0))
    assert len(steps) == schedule.steps and steps[0].t0 == 0.0 and steps[-1].t1 == schedule.end
    for one, next_one in pairwise(steps):
        assert one.t1 == pytest.approx(next_one.t0, abs=1e-12) and one.dt == one.whole and not one.cut
    assert sum(step.dt for step in steps) == pytest.approx(schedule.end, abs=1e-12)
    assert all((step.phase == RESTING) == (step.t1 < schedule.start + 1e-9) for step in steps)


def test_a_later_end_keeps_the_grid() -> None:
    """Fails when steps before the cut one move with the end of the run, or the cut one loses its phase."""
    short, long = (Schedule(dt=1 / 16 / 32, phases=32, start=0.05, end=end) for end in (0.3217, 0.5))
    *whole, cut = short.from_step(0)
    assert whole == list(long.from_step(0))[: len(whole)]
    other = long.step(cut.index)
    assert cut.cut and (cut.t0, cut.whole, cut.phase) == (other.t0, other.dt, other.phase)


@pytest.mark.parametrize("step", ["3 s", "14 ms", "0.33 s"])
def test_runs_over_bed_speeds_end_alike(step: str) -> None:
    """Fails when the step, aligned with the columns of a bed of any speed, carries a run past its end."""
    for speed in ("0 m/s", "0.9 cm/s", "1.3 cm/s", "3 cm/s"):
        schedule = Schedule.from_case(
            zone({**SHORT, "time.end": "10 s", "time.step": step, "motion.bed_velocity": speed}, TINY)
        )
        assert schedule.step(schedule.steps - 1).t1 == 10.0


def test_output_at_the_first_step_that_reaches_a_multiple() -> None:
    """Fails when an output time is missed or doubled where the interval does not fall on steps."""
    schedule = Schedule(dt=0.3, phases=1, start=0.0, end=2.0)
    times = [s.t1 for s in schedule.from_step(0) if schedule.is_output(s, 0.5)]
    assert times == pytest.approx([0.6, 1.2, 1.5, 2.0])


def test_steps_fit_the_shifts_of_the_bed() -> None:
    """Fails when columns stay for a different number of steps: 5 mm at 1.3 cm/s take 0.385 s."""
    shift = 5e-3 / 0.013
    assert aligned_step(0.014, column=5e-3, speed=0.013) == pytest.approx(shift / 28)
    assert aligned_step(1.0, column=5e-3, speed=0.013) == pytest.approx(2 * shift)
    assert aligned_step(0.014, column=5e-3, speed=0.0) == 0.014


def test_a_strip_without_a_bed_does_not_align_its_steps() -> None:
    """Fails when `motion.bed_velocity`, which `mpm check` calls idle where no layer moves, shortens the steps there."""
    layers = [{"name": "gas", "height": "6 mm", "cells": 6}]
    steps = {
        speed: Schedule.from_case(
            strip_case(layers, columns=30, length=0.06, motion={"gamma": 0.0, "bed_velocity": speed})
        )
        for speed in ("0 m/s", "1.3 cm/s")
    }
    assert steps["0 m/s"] == steps["1.3 cm/s"]
