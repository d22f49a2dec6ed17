"""The linear systems of Newton's method on reacting species, and where rates are taken for linear."""

import numpy as np
import pytest

from mpm.errors import ConvergenceError
from mpm.physics.kinetics import BENT, SurfaceKinetics
from mpm.reactor.reactor import Reactor
from mpm.transport.local_terms import mutual_coupling
from mpm.transport.newton import NewtonSystem
from mpm.transport.step_matrix import CORRECTIONS, StepMatrix

from .cases import SHORT, TINY, cycle, zone


def random_blocks(diagonal: np.ndarray, strength: float, one_way: bool) -> np.ndarray:
    """Blocks (cells, 2, 2) with `diagonal` and beside it up to `strength` of that; if `one_way` only the second species feels the first."""
    blocks = strength * diagonal.T[:, :, None] * np.random.default_rng(3).random((diagonal.shape[1], 2, 2))
    if one_way:
        blocks[:, 0, 1] = 0.0
    for i in range(2):
        blocks[:, i, i] += diagonal[i]
    return blocks


@pytest.mark.parametrize("one_way", [False, True])
@pytest.mark.parametrize("strength", [0.0, 1e-3, 1.0, 30.0])
def test_reactions_in_the_gas_enter_the_step(strength: float, one_way: bool) -> None:
    """Fails when Newton's step is that of a matrix without the couplings by reactions, both ways or from one species to the other alone."""
    system = Reactor(cycle(SHORT, TINY)).system
    transport, operators = system.transport, system.operators(system.velocity)
    newton, dt = NewtonSystem(transport.reactions), 0.05
    matrices = [StepMatrix(system.strip, "species", 0.0) for _ in range(2)]
    for matrix, operator in zip(matrices, operators, strict=False):
        matrix.update(operator, dt)
    newton.set_fluxes(matrices)
    diagonal = np.stack([matrix.diagonal for matrix in matrices])
    residual = np.random.default_rng(4).standard_normal(diagonal.shape)
    blocks = random_blocks(diagonal, strength, one_way)
    newton.blocks[:] = blocks
    step = newton.solve(residual, 1e-12, mutual_coupling(blocks))
    storage = transport.reactions.gas_volume / dt
    fluxes = transport.flux_product(operators[:2], step) + storage * step
    sources = np.einsum("nij,jn->in", blocks, step) - diagonal * step
    np.testing.assert_allclose(fluxes + sources, residual, atol=1e-9)


def test_the_last_correction_of_a_product_counts() -> None:
    """Fails when a residual that the last correction takes away is an error all the same, or one that stays is none."""
    system = Reactor(zone(SHORT, TINY)).system
    matrix = StepMatrix(system.strip, "product", 0.0)
    matrix.update(system.operators(system.velocity)[0], 0.05)
    rhs, solver = np.random.default_rng(5).random(system.strip.owned), matrix._krylov

    class Late:
        """Corrects nothing before its `first` call."""

        def __init__(self, first: int):
            self.left = first

        def factorise(self) -> None:
            solver.factorise()

        def solve(self, missing: np.ndarray, tolerance: float, least: float) -> tuple[np.ndarray, int]:
            self.left -= 1
            return (np.zeros_like(missing), 0) if self.left > 0 else solver.solve(missing, tolerance, least)

    def found(first: int) -> np.ndarray:
        matrix.__dict__["_krylov"] = Late(first)
        return matrix.solve(rhs, np.zeros_like(rhs))

    solver.factorise()
    np.testing.assert_allclose(matrix.multiply(found(CORRECTIONS)), rhs, rtol=1e-9, atol=1e-9)
    with pytest.raises(ConvergenceError, match="a residual of"):
        found(CORRECTIONS + 1)


def test_mutual_coupling() -> None:
    """Fails when a coupling that comes back by way of a third species is overlooked, or one that never does is counted."""
    blocks = np.tile(np.eye(3), (4, 1, 1))
    blocks[1, 0, 1] = 1e6  # one way
    assert mutual_coupling(blocks) == 0.0
    assert mutual_coupling(blocks[:, :2, :2]) == 0.0
    blocks[2, 0, 1] = blocks[2, 1, 2] = blocks[2, 2, 0] = -0.5
    assert mutual_coupling(blocks) == pytest.approx(0.125)
    blocks[3, 0, 1] = blocks[3, 1, 0] = 0.6
    assert mutual_coupling(blocks) == pytest.approx(0.36)
    assert mutual_coupling(blocks[:, :2, :2]) == pytest.approx(0.36)


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
