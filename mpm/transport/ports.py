"""What enters the strip through its ports: the feed of inlets while they dose, and gas that outlets draw back in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mpm.arrays import Floats
from mpm.mesh.strip import Strip
from mpm.parallel import total
from mpm.transport.fluxes import FluxOperator

if TYPE_CHECKING:
    from mpm.case.case import Case
    from mpm.case.ports import Inlet


class Ports:
    """The ports of a case for the species `names`.

    `feed` (inlets, species) [mol/m3] is what each inlet brings while it doses, `largest_feed` [mol/m3] the largest of it and `feed_rate`
    [mol/m/s] the scale of all residuals: the largest flow of a species through one inlet.
    """

    def __init__(self, case: Case, strip: Strip, names: Sequence[str]):
        self.case, self.strip, self.names = case, strip, tuple(names)
        inlets = case.geometry.inlets
        amounts = [case.feed_concentrations(inlet.mass_fractions) for inlet in inlets]
        self.feed = np.array([[fed.get(name, 0.0) for name in names] for fed in amounts]).reshape(
            len(inlets), len(names)
        )
        self.largest_feed = float(self.feed.max(initial=0.0))
        diffusivity = max((case.gas.diffusivity[name] for name in names), default=0.0)
        diffusion = diffusivity / strip.grid.height  # brings in a feed without flow, over the strip's height
        self.feed_rate = max(
            (
                (inlet.velocity + diffusion) * inlet.width * float(fed.max(initial=0.0))
                for inlet, fed in zip(inlets, self.feed, strict=True)
            ),
            default=0.0,
        )

    def shares(self, t0: float, dt: float) -> Floats:
        """Share of the step of `dt` from `t0` [s] during which each inlet doses, (inlets,)."""
        return np.array([open_share(inlet, t0, dt) for inlet in self.case.geometry.inlets])

    @property
    def steady_shares(self) -> Floats:
        """1 for every inlet that doses without end, else 0, (inlets,)."""
        return np.array([float(inlet.stays_open) for inlet in self.case.geometry.inlets])

    def supply(self, operators: Sequence[FluxOperator], shares: Floats, drawn: dict[str, Floats]) -> Floats:
        """What enters each cell through ports, (species, own) [mol/m/s], of the first species as many as `operators`.

        `shares` (inlets,): part of the time during which each inlet doses; `drawn`: concentrations in what outlets draw back in.
        """
        supply = np.zeros((len(operators), self.strip.owned))
        for inlet, share, feed in zip(self.case.geometry.inlets, shares, self.feed, strict=True):
            for i, operator in enumerate(operators):
                if feed[i] * share > 0.0:
                    port = operator.inlets[inlet.name]
                    supply[i, port.cells] += port.into * (feed[i] * share)
        for name, means in drawn.items():
            port = operators[0].outlets[name]
            supply[:, port.cells] += port.into * means[:, None]
        return supply

    def outlet_means(self, operators: Sequence[FluxOperator], concentration: Floats) -> dict[str, Floats]:
        """Mean of the cells next to each outlet, (species,) [mol/m3 at the state of `[gas]`], where any outlet draws in (else nothing);
        collective.

        One row of cells, or two as in the thesis (`transport.backflow_rows`).
        """
        if not operators or not operators[0].drawn_in:
            return {}
        operator = operators[0]
        sums = []
        for port in operator.outlets.values():
            sums.append([*(concentration[:, port.near] @ port.weights), port.sizes.sum()])
        rows = total(self.strip.comm, sums)
        return {name: row[:-1] / row[-1] for name, row in zip(operator.outlets, rows, strict=True)}


def open_share(inlet: Inlet, t0: float, dt: float) -> float:
    """Share of the step of `dt` from `t0` [s] during which the inlet doses."""
    dosing = sum(max(min(stop, t0 + dt) - max(start, t0), 0.0) for start, stop in inlet.windows)
    return min(dosing / dt, 1.0)
