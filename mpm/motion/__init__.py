"""Where reactor and bed are at a time, and the steps that follow them: pure numpy."""
