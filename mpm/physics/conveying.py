"""How fast a vibrated conveyor can carry a bed at all.

SI throughout. "Seed" is the thesis whose chapters 2-5 the model follows; equation numbers are its own.
"""

import math

from mpm.constants import GRAVITY


def straight_drop_velocity(displacement: float, frequency: float) -> float:
    """Mean velocity [m/s] of a bed that moves with the base on extension and falls straight on retraction.

    v = 2 X f with the displacement amplitude X [m] along the conveyor and f [Hz] (seed 2.4.2). The seed prints 1.08 cm/s
    (226 um in 20.83 ms) for the waveform of table 2.2: that is the vertical amplitude, 113.0 um. The one along the
    conveyor, from which it has its perfect flight of 3.51 cm/s, is 116.3 um and gives 1.117 cm/s.
    """
    return 2.0 * displacement * frequency


def perfect_flight_velocity(displacement: float, frequency: float) -> float:
    """Mean velocity [m/s] of a bed always launched at the base's largest velocity: v = 2 pi f X (seed 2.4.2)."""
    return 2.0 * math.pi * frequency * displacement


def throw_number(acceleration: float, declination: float = 0.0) -> float:
    """Largest downward acceleration of the base [m/s2], normal to it, over the normal component of gravity, a/(g cos alpha).

    `declination` alpha in rad. Above 1 a particle is thrown without the help of gas. The seed's Gamma is that of a level
    base, A_v/g, also where the conveyor is declined (section 3.6): 1.2 % less at 9 deg.
    """
    return acceleration / (GRAVITY * math.cos(declination))


def efficiency(mean_velocity: float, extension_velocity: float) -> float:
    """Convection efficiency, |mean bed velocity / largest base velocity on extension| (2-13)."""
    return abs(mean_velocity / extension_velocity)
