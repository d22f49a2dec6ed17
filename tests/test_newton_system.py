"""The linear systems of Newton's method on reacting species, and where rates are taken for linear."""

import numpy as np
import pytest

from mpm.physics.kinetics import BENT, SurfaceKinetics
from mpm.reactor.reactor import Reactor
from mpm.transport.newton import NewtonSystem

from .cases import SHORT, TINY, cycle, zone


@pytest.mark.parametrize("strength", [0.0, 1e-3, 1.0, 30.0])
def test_reactions_in_the_gas_enter_the_step(strength: float) -> None:
    """Fails when Newton's step is that of the preconditioner, which does not know how reactions of the gas couple species."""
    system = Reactor(cycle(SHORT, TINY)).system
    transport, operators = system.transport, system.operators(system.velocity)
    newton = NewtonSystem(transport.reactions, 1)
    assert newton.unknowns == 2
    assert transport.reactions.gas.reactions
    diagonal = newton.set_fluxes(operators[:2]) + transport.reactions.gas_volume / 0.05
    rng = np.random.default_rng(3)
    blocks = strength * diagonal.T[:, :, None] * rng.random((diagonal.shape[1], 2, 2))
    for i in range(2):
        blocks[:, i, i] += diagonal[i]
    residual = rng.standard_normal(diagonal.shape)
    step = newton.solve(blocks, residual, 1e-12, first=True)
    storage = transport.reactions.gas_volume / 0.05
    fluxes = transport.flux_product(operators[:2], step) + storage * step
    sources = np.einsum("nij,jn->in", blocks, step) - diagonal * step
    np.testing.assert_allclose(fluxes + sources, residual, atol=1e-9)


def test_where_rates_are_linear() -> None:
    """Fails when a cell whose sites run out within a step counts as linear, or one counts as bent in which nothing can change."""
    case = zone(mesh=TINY)
    n = 40
    kinetics = SurfaceKinetics(case.mechanism, ("TMA",), np.full(n, 1e-5), 473.0)
    concentration = np.logspace(-14, 0, n)[None]
    theta, dt = np.vstack([np.ones(n), np.zeros(n)]), 0.02
    bent = kinetics.bends(concentration, theta, dt)
    assert 0 < bent.sum() < n
    rates, slopes = kinetics.rates(concentration, theta, dt)
    off = np.abs(1.0 - slopes[0, 0] * concentration[0] / rates[0])
    assert off[~bent].max() < 2.0 * BENT < off[bent].max()
    assert not kinetics.bends(concentration, theta[::-1], dt).any()
