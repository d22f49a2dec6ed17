"""The `[motion]` table of a case: vibration of the reactor and conveying of the bed, checked.

`mpm.motion.kinematics` is what it makes them do.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, SerializerFunctionWrapHandler, model_serializer, model_validator

from mpm.case.model import Frozen
from mpm.case.profile import PRESETS, BedProfile, read_profile
from mpm.constants import GRAVITY, TURN
from mpm.physics.bed_cycle import BedCycle
from mpm.units import (
    Adhesion,
    Angle,
    BedSpeed,
    Frequency,
    Instant,
    NonNegative,
    Positive,
    Velocity,
    reject,
    worked_out,
)

SAME_FREQUENCY = 0.01
"""Relative difference up to which a profile belongs to a vibration: a DEM's waveform may be fitted to a record of the same machine."""
FORCES = ("friction", "adhesion", "gas_column", "through_flow", "through_velocity")
"""Keys that the profile force_balance alone reads."""


class Motion(Frozen):
    """Vibration of the reactor and conveying of the bed."""

    gamma: NonNegative = 0.30
    """largest vertical acceleration of the reactor over g; 0: no vibration, the bed moves steadily at bed_velocity (profile force_balance:
    it rests)"""
    frequency: Frequency = 16.0
    """frequency of the vibration"""
    angle: Angle = math.pi / 3.0
    """direction of the vibration, counted from angle_from; it must have a vertical component"""
    angle_from: Literal["horizontal", "vertical"] = "horizontal"
    """what the angle is counted from"""
    bed_velocity: BedSpeed = 0.013
    """mean speed at which the bed is conveyed, relative to the reactor, to the right; 0: it stays. A profile file and force_balance bring
    their own"""
    profile: Annotated[str, Field(json_schema_extra={"presets": [*PRESETS]})] = "thesis"
    """how the bed moves within a cycle: thesis (lift-off at liftoff_velocity), phases (liftoff_phase and contact_phase), force_balance
    (as weight, gas and friction make it: mean velocity and phases follow), or the path of a CSV file from `mpm dem`"""
    liftoff_velocity: Velocity = -0.004
    """vertical velocity of the reactor at which the bed lifts off (profile thesis)"""
    liftoff_phase: Angle | None = None
    """phase of the cycle at which the bed lifts off, 0 deg to below 360 deg (profile phases)"""
    contact_phase: Angle | None = None
    """phase of the cycle at which the bed lands again, 0 deg to below 360 deg (profile phases)"""
    friction: Positive = 0.4
    """coefficient of friction between the bed and what it lies on (profile force_balance)"""
    adhesion: Adhesion = 0.0
    """stress with which the bed adheres to what it lies on, on top of its weight (profile force_balance)"""
    gas_column: Literal["reactor", "lab"] = "reactor"
    """what the gas below the bed moves with (profile force_balance): the reactor, whose floor is closed between the ports, or the
    laboratory, as under an open floor, where a bed that rises draws gas in"""
    through_flow: Literal["total", "local"] = "total"
    """gas that carries part of the bed (profile force_balance). total: inflow below the bed over the strip's area; local: the most that
    rises above a port, by the estimate of `mpm check`"""
    through_velocity: Velocity | None = worked_out("through_flow, from the ports", None, example="0.2 cm/s")
    """superficial velocity of the gas that rises through the bed, in place of through_flow (profile force_balance)"""
    drag_reference: Literal["pore", "superficial"] = "pore"
    """velocity of the superficial gas at which a moving bed does not drag on it. pore: eps times the bed's; superficial: the bed's"""
    inlet_frame: Literal["reactor", "lab"] = "reactor"
    """what the inlets are fixed to: they ride on the reactor, or stand still in the laboratory while it moves over them"""
    start: Instant = 0.05
    """when vibration and conveying start"""
    startup: Literal["developed", "impulsive"] = "developed"
    """how a resolved run begins to vibrate: in the periodic state of the gas, or from rest with the true transient"""

    _file: BedProfile | None = PrivateAttr(None)
    _balance: BedCycle | None = PrivateAttr(None)

    @property
    def balances(self) -> bool:
        """Whether the bed moves as its forces make it."""
        return self.profile == "force_balance"

    @property
    def balance(self) -> BedCycle | None:
        """The cycle that its forces make the bed repeat, which its case works out; None without vibration, or with another profile."""
        if self.balances and self.gamma > 0.0 and self._balance is None:
            raise ValueError("motion: the forces on a bed are those of a case")
        return self._balance

    def complete(self, balance: BedCycle) -> None:
        """Take the motion that the case has worked out."""
        self._balance = balance

    @property
    def amplitudes(self) -> tuple[float, float, float]:
        """A_x, A_y [m] and w [1/s] of the displacement: A_y = Gamma g/w^2, the angle counted from the horizontal or the vertical."""
        omega = TURN * self.frequency
        ay = self.gamma * GRAVITY / omega**2
        slope = math.tan(self.angle)
        return ay / slope if self.angle_from == "horizontal" else ay * slope, ay, omega

    @property
    def table(self) -> BedProfile | None:
        """The profile file's content; None without vibration, or without such a file."""
        return self._file if self.gamma > 0.0 else None

    @property
    def phases(self) -> tuple[float, float] | None:
        """Phases of lift-off and contact [rad] where the case gives them (profile phases)."""
        if self.profile != "phases" or self.liftoff_phase is None or self.contact_phase is None:
            return None
        return self.liftoff_phase, self.contact_phase

    @property
    def profile_content(self) -> str:
        """The text of the profile file, by which cases are told apart, else the name of the preset."""
        return self.profile if self._file is None else self._file.text

    @property
    def mean_velocity(self) -> float:
        """Cycle mean of the bed's velocity in the reactor's frame [m/s], negative to the left.

        It is that of the profile file or of the forces, else `bed_velocity`.
        """
        if self.balances:
            return 0.0 if self.balance is None else self.balance.mean
        return self.bed_velocity if self.table is None else self.table.mean

    @property
    def peak_vertical_velocity(self) -> float:
        """Amplitude of the reactor's vertical velocity, Gamma g / w [m/s]."""
        return self.gamma * GRAVITY / (TURN * self.frequency)

    @model_validator(mode="after")
    def _check(self) -> Self:
        low, high = (0.0, math.pi / 2.0)
        steep = self.angle <= low if self.angle_from == "horizontal" else self.angle >= high
        if not low <= self.angle <= high or steep:
            raise reject(
                f"{math.degrees(self.angle):g} deg from the {self.angle_from}",
                "an angle from 0 deg to 90 deg that leaves a vertical component",
                key="angle",
            )
        if self.profile not in PRESETS:
            self._file = self._read_file()
        elif self.gamma == 0.0 or self.balances:
            pass  # no phases to check
        elif self.profile == "thesis":
            peak = self.peak_vertical_velocity
            if not -peak < self.liftoff_velocity < 0.0:
                raise reject(
                    f"{self.liftoff_velocity:g} m/s",
                    f"between 0 m/s and the reactor's peak velocity, {-peak:.4g} m/s",
                    key="liftoff_velocity",
                )
        else:
            for key in ("liftoff_phase", "contact_phase"):
                value = getattr(self, key)
                if value is None or not 0.0 <= value < TURN:
                    raise reject(
                        "nothing" if value is None else f"{math.degrees(value):g} deg",
                        'an angle from 0 deg to below 360 deg, e.g. "97.85 deg", for profile = "phases"',
                        key=key,
                    )
            if self.liftoff_phase == self.contact_phase:
                raise reject("the phase of lift-off", "another phase", key="contact_phase")
        return self

    def _read_file(self) -> BedProfile:
        """Read the profile file; it must be one even where nothing vibrates, and of this frequency where something does."""
        profile = read_profile(Path(self.profile))
        made = profile.conditions
        if (
            self.gamma > 0.0
            and made is not None
            and abs(made.frequency - self.frequency) > SAME_FREQUENCY * self.frequency
        ):
            raise reject(
                f"{self.profile}: a profile made at {made.frequency:.6g} Hz for a vibration at {self.frequency:.6g} Hz, in whose cycle its "
                "bed would hop to another beat",
                f'a profile made at {self.frequency:.6g} Hz, or frequency = "{made.frequency:.6g} Hz"',
                key="profile",
            )
        return profile

    @model_serializer(mode="wrap")
    def _write_what_rules(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without `bed_velocity` where a profile file or forces say how fast the bed moves, without what makes forces where none do."""
        table: dict[str, Any] = handler(self)
        if self.table is not None or self.balances:
            table.pop("bed_velocity", None)
        for key in () if self.balances else FORCES:
            table.pop(key, None)
        return table
