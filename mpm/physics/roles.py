"""Which species a run has to follow, and how: those that react together, those that are only made, and none that nothing brings in."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpm.physics.mechanism import Mechanism
    from mpm.physics.reaction import Reaction


@dataclass(frozen=True)
class Roles:
    """Species of a run by what they do.

    `coupled` react and are solved together; `products` are only made (or inert) and follow one by one; all others stay absent
    because nothing feeds or makes them.
    """

    coupled: tuple[str, ...]
    products: tuple[str, ...]

    @classmethod
    def of(cls, mechanism: Mechanism, fed: Collection[str]) -> Roles:
        """Species that can appear when `fed` enter.

        A reaction runs once all gases of one of its ways are present; one without a gas, such as a desorption, always.
        """
        present: set[str] = set()
        running: list[Reaction] = []
        made = set(fed)
        while True:
            present |= made
            running = [*mechanism.running_surface(present), *mechanism.running_gas(present)]
            made = {name for reaction in running for name in (*reaction.nu_gas, *reaction.gases)}
            if made <= present:
                break
        reacting = {name for reaction in running for name in reaction.gases}
        order = [name for name in mechanism.species_names if name in present]
        return cls(tuple(n for n in order if n in reacting), tuple(n for n in order if n not in reacting))
