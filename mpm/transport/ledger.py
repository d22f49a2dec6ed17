"""What has passed since the start of a run: fed, let out, drawn back in, and how often each reaction has run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.arrays import Floats
from mpm.parallel import is_root, total

if TYPE_CHECKING:
    from mpi4py import MPI

    from mpm.parallel import Scatter
    from mpm.transport.fluxes import FluxOperator
    from mpm.transport.ports import Ports
    from mpm.transport.reactions import Events, Reactions


@dataclass(frozen=True, eq=False)
class Passed:
    """Sums over ranks, per metre of depth.

    Amounts [mol/m] per species of the run: `fed` (inlets, species) net of what diffuses or flows back out of the port, `out`, `back`
    (outlets, species); volumes [m2] `out_volume`, `back_volume` (outlets,).
    """

    fed: Floats
    out: Floats
    back: Floats
    out_volume: Floats
    back_volume: Floats

    @classmethod
    def nothing(cls, inlets: int, outlets: int, species: int) -> Passed:
        """A book without an entry."""
        by_outlet = (outlets, species)
        return cls(
            np.zeros((inlets, species)),
            np.zeros(by_outlet),
            np.zeros(by_outlet),
            np.zeros(outlets),
            np.zeros(outlets),
        )


Entries = tuple[
    Passed, Floats, Floats
]  # of the ledger at one instant: what has passed, surface and gas events


class Ledger:
    """The book of one rank: `passed` through its part of the ports, and events [mol/m] `surface` (reactions, reactive cells) and `gas`
    (reactions, own cells)."""

    def __init__(self, ports: Ports, reactions: Reactions):
        geometry = ports.case.geometry
        self.passed = Passed.nothing(len(geometry.inlets), len(geometry.outlets), len(reactions.species))
        none = reactions.none()
        self.surface, self.gas = none.surface, none.gas

    def memento(self) -> Entries:
        """The present entries, to go back to; cheap, because arrays are replaced and never changed in place."""
        return self.passed, self.surface, self.gas

    def recall(self, memento: Entries) -> None:
        """Go back to entries of this run."""
        self.passed, self.surface, self.gas = memento

    def book(
        self,
        ports: Ports,
        operators: Sequence[FluxOperator],
        concentration: Floats,
        dt: float,
        shares: Floats,
        drawn: dict[str, Floats],
        events: Events,
    ) -> None:
        """Enter `dt` [s] at one `concentration` (species, own) [mol/m3], with what `shares` of the inlets' feed and `drawn` gas brought in
        and the `events` of that time."""
        self.surface = self.surface + dt * events.surface
        self.gas = self.gas + dt * events.gas
        now = Passed(*(getattr(self.passed, f.name).copy() for f in fields(Passed)))
        for i, (operator, c) in enumerate(zip(operators, concentration, strict=True)):
            for k, port in enumerate(operator.inlets.values()):
                inside = ports.feed[k, i] * shares[k]
                now.fed[k, i] += dt * (port.into.sum() * inside - port.out @ c[port.cells])
            for k, (name, port) in enumerate(operator.outlets.items()):
                now.out[k, i] += dt * (port.out @ c[port.cells])
                if name in drawn:
                    now.back[k, i] += dt * port.into.sum() * drawn[name][i]
        for k, port in enumerate(operators[0].outlets.values() if operators else ()):
            now.out_volume[k] += dt * port.volume_out.sum()
            now.back_volume[k] += dt * port.into.sum()
        self.passed = now

    def totals(self, comm: MPI.Comm) -> Passed:
        """What has passed on all ranks; collective."""
        return Passed(*(total(comm, getattr(self.passed, f.name)) for f in fields(Passed)))

    def stored(self, comm: MPI.Comm, cells: Scatter, reactive: Scatter) -> dict[str, Any]:
        """Arrays of a restart state, events in grid order on rank 0 (None elsewhere); collective."""
        return {
            **vars(self.totals(comm)),
            "surface": reactive.to_root(self.surface),
            "gas": cells.to_root(self.gas),
        }

    def restore(self, comm: MPI.Comm, cells: Scatter, reactive: Scatter, stored: dict[str, Any]) -> None:
        """The inverse of `stored`, on every rank. Sums over ranks: rank 0 carries them on."""
        self.surface, self.gas = reactive.to_local(stored["surface"]), cells.to_local(stored["gas"])
        whole = Passed(**{f.name: stored[f.name] for f in fields(Passed)})
        self.passed = (
            whole
            if is_root(comm)
            else replace(whole, **{f.name: 0.0 * getattr(whole, f.name) for f in fields(Passed)})
        )
