"""Steps that are too long for explicit convection: seen when the flow leaves all bounds, and answered with the step to take."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from mpm.errors import ConvergenceError
from mpm.flow.courant import courant_number, driving_speed
from mpm.mesh.strip import Strip
from mpm.output.directory import RunDirectory
from mpm.output.vtu import read_pvd, read_vtu
from mpm.reactor.reactor import Reactor

from .cases import MPI, TINY, column_case, run, zone

FAST = {
    "fidelity": "resolved",
    "time.end": "1 s",
    "time.steps_per_cycle": 8,
    "output.every": "50 ms",
    "geometry.inlet.tma.velocity": "1 m/s",
    "geometry.inlet.purge.velocity": "1 m/s",
}
PACKING = {
    "porosity": 0.5, "permeability": "1e-9 m^2", "surface_to_volume": "0 1/m", "site_density": "1e-8 mol/m^2",
}  # fmt: skip
ADVICE = r"the flow diverges, gas at .* m/s .* take time\.steps_per_cycle = (\d+) \(found 8\) or more"


def test_courant_number_of_plug_flow() -> None:
    """Fails when it is not u dt / (eps h): 3 cm/s through pores of 0.5 in cells of 1 mm are 0.6 in 10 ms."""
    case = column_case(10e-3, 10, 0.03, PACKING)
    strip = Strip(case, MPI.COMM_SELF)
    upwards = np.zeros((4, strip.local))
    upwards[[0, 3]] = 0.03
    assert courant_number(strip, upwards, 0.01) == pytest.approx(0.03 * 0.01 / 0.5 / 1e-3, rel=1e-12)
    assert driving_speed(case) == pytest.approx(0.03)
    aslant = upwards.copy()
    aslant[1] = 0.02  # in through the left side
    assert courant_number(strip, aslant, 0.01) == pytest.approx((0.03 + 0.02) * 0.01 / 0.5 / 1e-3, rel=1e-12)


def assert_finite(folder: Path) -> None:
    """Every number that a run has written is one."""
    files = RunDirectory(folder)
    state = files.read_checkpoint()
    assert state is not None
    for name, values in state[0].items():
        assert np.isfinite(values).all(), name
    for _, path in read_pvd(files.pvd):
        for name, values in read_vtu(path).cell_data.items():
            assert np.isfinite(values).all(), name
    text = (folder / "history.csv").read_text() + (folder / "summary.json").read_text()
    assert not re.search("nan|inf(?!low)", text, re.IGNORECASE)


def test_a_diverging_flow_is_stopped_with_the_step_to_take(tmp_path: Path) -> None:
    """Fails when not-a-number reaches a file or the restart state, the run does not end as failed, going on ends otherwise, or the step
    that the message names does not do."""
    case = zone({**FAST, "motion.startup": "impulsive"}, TINY)
    with pytest.raises(ConvergenceError, match=rf"^step \d+: {ADVICE}") as first:
        Reactor(case, MPI.COMM_SELF).run(output=tmp_path / "run")
    assert_finite(tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["status"] == "failed" and 0.0 < summary["simulated_seconds"] < 1.0
    with pytest.raises(ConvergenceError) as second:
        Reactor(case, MPI.COMM_SELF).run(output=tmp_path / "run", resume=True)
    assert str(second.value) == str(first.value)
    assert_finite(tmp_path / "run")
    steps = re.search(ADVICE, str(first.value))
    assert steps
    run(case.with_({"time.steps_per_cycle": int(steps[1])}))


def test_a_diverging_cycle_is_stopped_with_the_step_to_take() -> None:
    """Fails when a developed run whose cycle cannot be marched to ends without saying which step does."""
    with pytest.raises(ConvergenceError, match=ADVICE):
        Reactor(zone(FAST, TINY), MPI.COMM_SELF).run()
