"""Dispersion by vibration: Watson's exact result in a channel, its rates of convergence, and its use in runs."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.constants import GRAVITY
from mpm.errors import InputError
from mpm.flow.cycle import periodic_flow
from mpm.flow.problem import FlowProblem
from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion
from mpm.reactor.reactor import Reactor
from mpm.transport.dispersion import dispersion_tensor, vibrational_dispersion

from .cases import MPI, SHORT, TINY, assert_same_numbers, rate, run, strip_case, zone

ON = {"transport.vibrational_dispersion": True, "time.steps_per_cycle": 8}


def watson(speed: float, omega: float, viscosity: float, diffusivity: float, height: float) -> float:
    """(D_eff - D)/D between walls that vibrate along themselves at `speed` cos(omega t), gas viscosity nu [m2/s].

    u = Re[U cosh(l y)/cosh(l a) e^(i w t)] relative to the fluid at infinity, l^2 = i w/nu; the corrector solves
    i w c + u - <u> = D c'' with no flux through the walls (Watson 1983, equation for nu != D).
    """
    a = height / 2.0
    flow, gas = np.sqrt(1j * omega / viscosity), np.sqrt(1j * omega / diffusivity)

    def profile(k: complex, y: np.ndarray) -> np.ndarray:
        """cosh(k y)/cosh(k a) without overflow."""
        return (np.exp(k * (y - a)) + np.exp(-k * (y + a))) / (1.0 + np.exp(-2.0 * k * a))

    mean = speed * np.tanh(flow * a) / (flow * a)
    constant, first = mean / (1j * omega), speed / (diffusivity * flow**2 - 1j * omega)
    second = -first * flow * np.tanh(flow * a) / (gas * np.tanh(gas * a))
    nodes, weights = np.polynomial.legendre.leggauss(400)
    y = a * nodes
    corrector = constant + first * profile(flow, y) + second * profile(gas, y)
    product = (np.conj(speed * profile(flow, y) - mean) * corrector).real
    return float(-0.5 * (weights @ product) / 2.0 / diffusivity)


def channel(
    height: float, amplitude: float, omega: float, viscosity: float, diffusivity: float, **mesh: int
) -> float:
    """Mean of K_xx over the channel, over D, from the discrete periodic flow; K_yy must vanish."""
    gamma = amplitude * omega**2 * math.tan(math.pi / 3.0) / GRAVITY
    case = strip_case(
        [{"name": "gas", "height": f"{height!r} m", "cells": mesh["cells"]}],
        length=0.3 * height,
        motion={
            "gamma": gamma, "frequency": f"{omega / 2.0 / math.pi!r} Hz", "angle": "60 deg", "bed_velocity": "0 m/s",
        },
        gas={"viscosity": f"{viscosity!r} Pa s", "density": "1 kg/m^3", "diffusivity": f"{diffusivity!r} m^2/s"},
    )  # fmt: skip
    strip, bed = Strip(case, MPI.COMM_SELF), BedMotion(case.motion)
    problem = FlowProblem(case, strip, bed.vibration.period / mesh["steps"])
    fields = periodic_flow(problem, bed, mesh["steps"])
    tensor = dispersion_tensor(case, strip, fields, bed.vibration.period, diffusivity)
    assert np.abs(tensor[1, 1]).max() < 1e-12 * diffusivity
    return float(tensor[0, 0] @ strip.volume / strip.volume.sum() / diffusivity)


@pytest.mark.parametrize(
    ("schmidt", "frequency", "expected"),
    [
        (0.5, 10.0, 0.117795688),
        (2.0, 10.0, 0.030875213),
        (0.5, 100.0, 1.380976617),
        (2.0, 100.0, 2.048385457),
    ],
)
def test_watson(schmidt: float, frequency: float, expected: float) -> None:
    """Fails when the dispersion in a channel of unit height and D, amplitude 1, is more than 2.5 % off Watson's exact one.

    `expected` comes from an independent implementation, checked there by finite differences.
    """
    assert watson(frequency, frequency, schmidt, 1.0, 1.0) == pytest.approx(expected, rel=1e-7)
    found = channel(1.0, 1.0, frequency, schmidt, 1.0, cells=60, steps=192)
    assert found == pytest.approx(expected, rel=0.025)


def test_watson_in_the_thesis_strip() -> None:
    """Fails when dispersion at the thesis' vibration (Gamma 0.3, 16 Hz, 5 mm between walls) is off Watson's 0.18 % of D by 2 %."""
    omega, amplitude = 32.0 * math.pi, 1.68124085e-4
    expected = watson(amplitude * omega, omega, 1.72e-5 / 0.72167, 2.88e-5, 5e-3)
    assert expected == pytest.approx(0.001808383, rel=1e-5)
    found = channel(5e-3, amplitude, omega, 1.72e-5 / 0.72167, 2.88e-5, cells=80, steps=256)
    assert found == pytest.approx(expected, rel=0.02)


def test_rates_of_convergence() -> None:
    """Fails when the error is not of first order in the time step (backward Euler) or of second order in the mesh."""
    exact = watson(10.0, 10.0, 0.5, 1.0, 1.0)
    in_time = [abs(channel(1.0, 1.0, 10.0, 0.5, 1.0, cells=96, steps=n) / exact - 1.0) for n in (32, 64, 128)]
    assert 0.8 < rate([1 / 32, 1 / 64, 1 / 128], in_time) < 1.2, in_time
    finest = channel(1.0, 1.0, 10.0, 0.5, 1.0, cells=96, steps=32)
    in_space = [abs(channel(1.0, 1.0, 10.0, 0.5, 1.0, cells=n, steps=32) - finest) for n in (6, 12, 24)]
    assert 1.7 < rate([1 / 6, 1 / 12, 1 / 24], in_space) < 2.4, in_space


def test_dispersion_of_the_reactor() -> None:
    """Fails when dispersion at the base case is no small correction, does not grow with the amplitude, or remains without vibration."""
    means = []
    for gamma in (0.0, 0.3, 0.6):
        case = zone({"motion.gamma": gamma, "time.steps_per_cycle": 32}, TINY)
        strip = Strip(case, MPI.COMM_SELF)
        k = vibrational_dispersion(case, strip, BedMotion(case.motion), [2.88e-5])
        assert k.shape == (1, 2, strip.local)
        means.append(float(k[0, 0] @ strip.volume / strip.volume.sum()) / 2.88e-5)
    assert means[0] == 0.0
    assert 0.0 < means[1] < 0.05
    assert means[2] > 2.0 * means[1]


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_option_is_used(fidelity: str, tmp_path: Path) -> None:
    """Fails when the option is not read, changes more than a small correction should, or breaks a balance; steady and averaged alike."""
    changes: dict[str, Any] = {**SHORT, "fidelity": fidelity}
    _, plain = run(zone(changes, TINY))
    _, dispersed = run(zone({**changes, **ON}, TINY))
    a, b = plain.field("C_CH4"), dispersed.field("C_CH4")
    assert 1e-7 < np.abs(a - b).max() / a.max() < 0.1


def test_restart_keeps_dispersion(tmp_path: Path) -> None:
    """Fails when a run that goes on from a restart state forgets the dispersion or counts it twice."""
    case = zone({**SHORT, **ON}, TINY)
    _, whole = run(case)
    run(case.with_({"time.end": "0.5 s"}), output=tmp_path / "half")
    reactor, resumed = run(case, output=tmp_path / "half", resume=True)
    assert reactor.flow.dispersion is not None
    assert_same_numbers(whole.summary, resumed.summary, 1e-10)


@pytest.mark.parametrize(
    "changes",
    [
        {"time.steps_per_cycle": 16},
        {"material.glass_beads.tortuosity_factor": 3.0},
        {"geometry.inlet_diffusion": True},
    ],
)
def test_flow_brings_no_dispersion_of_another_case(changes: dict[str, Any]) -> None:
    """Fails when a flow that is handed on brings a dispersion that was found with other steps, pores or inlets than this case's."""
    known = Reactor(zone(ON, TINY), MPI.COMM_SELF).flow
    case = zone({**ON, **changes}, TINY)
    handed = Reactor(case, MPI.COMM_SELF, flow=known).flow
    own = Reactor(case, MPI.COMM_SELF).flow
    assert handed.sequence is known.sequence
    assert handed.dispersion is not None and own.dispersion is not None
    np.testing.assert_allclose(handed.dispersion, own.dispersion, rtol=1e-9)


def test_resolved_run_refuses_the_option() -> None:
    """Fails when vibration could be counted twice."""
    with pytest.raises(InputError, match=r"vibrational_dispersion.*resolved"):
        zone({**ON, "fidelity": "resolved"})


@pytest.mark.parallel(alone=False)
def test_ranks_agree_on_dispersion() -> None:
    """Fails when the coefficients depend on the number of ranks."""
    case = zone({**SHORT, **ON, "fidelity": "steady"}, TINY)
    results = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        reactor = Reactor(case, comm)
        k = vibrational_dispersion(case, reactor.system.strip, reactor.system.bed_motion, [1e-5, 2.88e-5])
        results.append(reactor.system.strip.scatter.to_all(k[:, :, : reactor.system.strip.owned]))
    np.testing.assert_allclose(results[1], results[0], rtol=0.0, atol=1e-9 * np.abs(results[0]).max())


def test_dispersion_has_the_diffusivity_that_pores_leave() -> None:
    """Fails when the cell problem does not know `porous.diffusion`: "free" is eps D/tau^2 with a tortuosity factor that is the porosity."""
    by_hand: dict[str, Any] = {
        "material.glass_beads.tortuosity_factor": 0.46,
        "material.sintered_powder.tortuosity_factor": 0.37,
    }
    found = {}
    readings: dict[str, dict[str, Any]] = {
        "free": {"porous.diffusion": "free"},
        "by hand": by_hand,
        "effective": {},
    }
    for name, changes in readings.items():
        case = zone({**ON, "fidelity": "averaged", **changes}, TINY)
        strip = Strip(case, MPI.COMM_SELF)
        found[name] = vibrational_dispersion(case, strip, BedMotion(case.motion), [2.88e-5])
    scale = np.abs(found["free"]).max()
    np.testing.assert_allclose(found["free"], found["by hand"], atol=1e-9 * scale)
    assert np.abs(found["free"] - found["effective"]).max() > 0.05 * scale
