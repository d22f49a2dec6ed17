"""Constants of nature, SI (CODATA 2018, exact values) and standard gravity."""

GAS_CONSTANT = 8.31446261815324
"""Molar gas constant R [J/mol/K]."""
AVOGADRO = 6.02214076e23
"""Avogadro constant [1/mol]."""
GRAVITY = 9.80665
"""Standard acceleration of gravity [m/s2]; vibration amplitudes are given in multiples of it."""
