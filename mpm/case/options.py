"""The tables `[time]`, `[output]` and `[transport]` of a case: how it is run, not what it is."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Strict

from mpm.case.model import Flag, Frozen
from mpm.units import Duration, Interval, RunTime, WallTime


class Time(Frozen):
    """End of the simulation and its steps."""

    end: RunTime = 20.0
    """simulated time at which the run ends"""
    step: Duration = 0.01
    """longest time step of an averaged run; it is shortened to fit the shifts of the bed from column to column"""
    steps_per_cycle: Annotated[int, Strict(), Field(ge=4)] = 32
    """time steps per cycle of the vibration in a resolved run, and phases of the flow with vibrational_dispersion"""


class Output(Frozen):
    """How often results and restart states are written."""

    every: Interval = 0.25
    """simulated time between outputs: fields for pictures and ParaView, and rows of history.csv"""
    checkpoint: WallTime = 60.0
    """time on the clock between restart states, from which an interrupted run goes on"""
    phases: Annotated[int, Strict(), Field(ge=0, examples=[16])] = 0
    """phases of the vibration at which the last cycle is written for ParaView, with the points moving as the reactor does; a divisor of
    time.steps_per_cycle; 0: none"""


class TransportOptions(Frozen):
    """Options of the species' transport."""

    vibrational_dispersion: Flag = False
    """in averaged and steady runs: add to diffusion what the swinging gas disperses, from the flow of a whole cycle"""
