"""The quasi-steady state of a reactor: gas and coverage in one nonlinear system, and how it is solved."""
