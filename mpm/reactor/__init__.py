"""The coupling: one step after the other, the steady state, restart states."""
