"""Constants of nature, SI (CODATA 2018, exact values), gravity as the thesis takes it, and a full turn."""

import math

GAS_CONSTANT = 8.31446261815324
"""Molar gas constant R [J/mol/K]."""
AVOGADRO = 6.02214076e23
"""Avogadro constant [1/mol]."""
GRAVITY = 9.81
"""Acceleration of gravity [m/s2] of the thesis (section 2.2), in which vibration amplitudes are counted; the standard value is
9.80665, 0.03 % less."""
TURN = 2.0 * math.pi
"""One cycle of a vibration, as a phase [rad]."""
