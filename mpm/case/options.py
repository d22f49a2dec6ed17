"""The tables `[time]`, `[output]`, `[transport]` and `[porous]` of a case: how it is run and counted, not what it is."""

from __future__ import annotations

from typing import Annotated, Literal

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
    """How species (and heat) are carried from cell to cell."""

    scheme: Literal["fitted", "upwind", "central"] = "fitted"
    """flux between two cells. fitted: exponential fitting, exact in one dimension; upwind: first order, adds |u| h/2 to diffusion; central:
    second order, upwind where a cell's Peclet number is above 2"""
    backflow_rows: Annotated[int, Strict(), Field(ge=1, le=2)] = 1
    """rows of cells next to an outlet whose mean it draws back in"""

    vibrational_dispersion: Flag = False
    """in averaged and steady runs: add to diffusion what the swinging gas disperses, from the flow of a whole cycle"""


class Porous(Frozen):
    """Conventions of a porous medium that codes do not share. The first of each is that of `docs/source.md`."""

    diffusion: Literal["effective", "free", "printed"] = "effective"
    """what pores leave of the diffusivity D of free gas. effective: eps D/tau^2; free: D; printed: eps D/tau, as the thesis has it"""
    inertia: Literal["interstitial", "superficial"] = "interstitial"
    """inertia of the gas in pores. interstitial: (rho/eps) du/dt + (rho/eps^2) u.grad u; superficial: eps rho du/dt + rho u.grad u"""
    reaction_volume: Literal["gas", "total"] = "gas"
    """volume that gas reactions run in: that of the gas in the pores, or the whole"""
