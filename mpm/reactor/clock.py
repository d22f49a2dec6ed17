"""How far a run has come, in simulated and in wall time."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import monotonic


@dataclass
class Clock:
    """`time` [s] and `steps` done of `all_steps` until `end` [s]; `worst_balance` of those reported last.

    `wall_before` [s] is the wall time of the parts of a run before a restart.
    """

    end: float
    all_steps: int
    time: float = 0.0
    steps: int = 0
    worst_balance: float = 0.0
    wall_before: float = 0.0
    begun: float = field(default_factory=monotonic)

    def begin(self) -> None:
        """Count wall time from now on."""
        self.begun = monotonic()

    @property
    def wall(self) -> float:
        """Wall time so far [s], of the parts before a restart too."""
        return self.wall_before + monotonic() - self.begun
