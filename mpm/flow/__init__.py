"""The gas: terms of the momentum equation, their solution, the periodic cycle, and the numbers of a flow."""
