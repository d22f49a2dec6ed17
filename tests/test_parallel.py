"""The same run on one rank and on all ranks: the physical numbers of its summary, its fields and its history agree to 1e-8."""

from pathlib import Path

import numpy as np
import pytest

from mpm import parallel
from mpm.arrays import Floats
from mpm.case.case import Case
from mpm.errors import InputError
from mpm.parallel import Scatter, on_root, total, total_and_largest
from mpm.reactor.reactor import Reactor

from .cases import HEATED, MPI, SHORT, TINY, assert_same_numbers, cycle, run, zone
from .general import SIX_GASES

COMM = MPI.COMM_WORLD
pytestmark = pytest.mark.parallel

CASES: dict[str, Case] = {
    "averaged": zone({**SHORT, "output.every": "0.5 s"}),
    "resolved": zone(
        {"fidelity": "resolved", "time.end": "0.2 s", "time.steps_per_cycle": 16, "output.every": "0.1 s"}, TINY
    ),
    "impulsive, ports reversing in the lab": zone(
        {
            "fidelity": "resolved", "time.end": "0.25 s", "output.every": "0.1 s",
            "motion.startup": "impulsive", "motion.inlet_frame": "lab", "motion.gamma": 0.6,
        },
        TINY,
    ),
    "both precursors, every species its own diffusivity": cycle(
        {
            "time.end": "4 s", "time.step": "40 ms", "output.every": "2 s", "geometry.bed_inflow": "periodic",
            "gas.diffusivity": {"TMA": "1e-5 m^2/s", "H2O": "4e-5 m^2/s", "CH4": "3e-5 m^2/s", "Al(OH)3": "8e-6 m^2/s"},
        },
        TINY,
    ),
    "walls, inlet diffusion": zone(
        {"time.end": "0.5 s", "output.every": "0.25 s", "geometry.periodic": False, "geometry.inlet_diffusion": True}, TINY
    ),
    "heated, averaged": zone({"time.end": "0.5 s", "output.every": "0.25 s", **HEATED}, TINY),
    "heated, resolved": zone(
        {"fidelity": "resolved", "time.end": "0.2 s", "time.steps_per_cycle": 16, "output.every": "0.1 s", **HEATED}, TINY
    ),
    "heated, impulsive": zone(
        {
            "fidelity": "resolved", "time.end": "0.2 s", "time.steps_per_cycle": 16, "output.every": "0.1 s",
            "motion.startup": "impulsive", **HEATED,
        },
        TINY,
    ),
    "heated, steady": zone({"fidelity": "steady", **HEATED}, TINY),
    "six gases, averaged": zone(
        {"time.end": "6 s", "time.step": "60 ms", "output.every": "3 s", **SIX_GASES}, TINY
    ),
    "six gases, steady": zone({"fidelity": "steady", **SIX_GASES}, TINY),
}  # fmt: skip


@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize("name", CASES)
def test_ranks_agree(name: str, tmp_path: Path) -> None:
    """Fails when any physical number, field or history entry depends on the number of ranks by more than 1e-8.

    The reference is computed in the same process on one rank. Files are written in the parallel run, which every rank must survive.
    """
    case = CASES[name]
    _, alone = run(case, MPI.COMM_SELF)
    _, together = run(case, COMM, output=tmp_path / "run")
    assert together.summary["ranks"] == COMM.size and alone.summary["ranks"] == 1
    assert_same_numbers(alone.summary, together.summary, 1e-8)
    first, *_ = case.fed_species
    made = "CH4" if first == "TMA" else "C"
    for field in (f"C_{first}", f"C_{made}", "velocity", *(("temperature",) if case.energy else ())):
        a, b = alone.field(field), together.field(field)
        np.testing.assert_allclose(b, a, rtol=0.0, atol=1e-8 * np.abs(a).max(), err_msg=field)
    site = case.mechanism.site_names[0]
    np.testing.assert_allclose(together.coverage("bed", site), alone.coverage("bed", site), atol=1e-8)
    for column, values in alone.history.items():
        if not column.startswith(("balance.", "cvd.")) and not column.endswith(
            "balance_error"
        ):  # the gas reaction begins at 1e-30 of its later rate
            np.testing.assert_allclose(
                together.history[column], values, rtol=1e-7, atol=1e-12, err_msg=column
            )
    if COMM.rank == 0:
        states = () if case.fidelity == "steady" else ("checkpoint.npz",)
        for file in ("summary.json", "history.csv", "fields.pvd", *states, "case.toml", "run.log"):
            assert (tmp_path / "run" / file).exists(), file


def test_every_rank_has_cells() -> None:
    """Fails when the mesh is not spread over the ranks: the other tests would prove nothing."""
    reactor = Reactor(CASES["averaged"], COMM)
    owned = reactor.system.strip.owned
    assert owned > 0.5 * reactor.grid.cells / COMM.size
    assert total(COMM, [owned])[0] == reactor.grid.cells


def test_errors_on_the_first_rank_reach_all(tmp_path: Path) -> None:
    """Fails when a refusal that only rank 0 can see (a directory that is not empty) leaves the other ranks waiting."""
    if COMM.rank == 0:
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "notes.txt").write_text("mine\n")
    COMM.Barrier()
    with pytest.raises(InputError):
        Reactor(zone(SHORT, TINY), COMM).run(output=tmp_path / "run")

    def fail() -> None:
        raise InputError("only here")

    with pytest.raises(InputError, match="only here"):
        on_root(COMM, fail)


def test_gathers_of_uneven_and_empty_shares() -> None:
    """Fails when a rank without values, or with all of them, breaks a gather."""
    mine = np.arange(5.0) if COMM.rank == 0 else np.empty(0)
    scatter = Scatter(COMM, mine.astype(np.int64), 5)
    np.testing.assert_array_equal(scatter.to_all(10.0 * mine), 10.0 * np.arange(5))
    both = scatter.to_all(np.stack([1.0 * mine, -1.0 * mine]))
    np.testing.assert_array_equal(both, [np.arange(5), -np.arange(5)])
    root = scatter.to_root(1.0 * mine)
    assert (root is None) == (COMM.rank != 0)
    nothing = Scatter(COMM, np.empty(0, np.int64), 0)
    assert nothing.to_all(np.empty((3, 0))).shape == (3, 0)


def test_sums_and_maxima_of_one_exchange() -> None:
    """Fails when a sum or a maximum misses a rank, or what is no number on one rank does not count as infinite on all."""
    rank, last = COMM.rank, COMM.size - 1
    sums, most = total_and_largest(COMM, [1.0, rank], [-rank, rank, np.nan if rank == last else 0.0])
    np.testing.assert_array_equal(sums, [COMM.size, sum(range(COMM.size))])
    np.testing.assert_array_equal(most, [0.0, last, np.inf])


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("large", [0, 8192])
@pytest.mark.parametrize("at_once", [1, 50, 250_000])
@pytest.mark.parametrize("lead", [(), (1,), (4,), (3, 2), (0,)])
def test_gathers_of_any_order_and_shape(
    lead: tuple[int, ...], at_once: int, large: int, kind: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when values of cells that lie in any order, on any rank, do not come to their places, arrays of them are mixed up, few or many
    at a time, round a ring or not, or they come in another precision."""
    monkeypatch.setattr(parallel, "AT_ONCE", at_once)
    monkeypatch.setattr(parallel, "LARGE", large)
    size = 23
    order = np.random.default_rng(3).permutation(size)
    owner = np.random.default_rng(4).integers(COMM.size, size=size)
    scatter = Scatter(COMM, order[owner == COMM.rank], size)
    whole: Floats = np.random.default_rng(5).random((*lead, size)).astype(kind)
    local = scatter.to_local(whole)
    everywhere = scatter.to_all(local)
    np.testing.assert_array_equal(everywhere, whole)
    assert everywhere.dtype == kind
    root = scatter.to_root(np.asfortranarray(local))
    if COMM.rank == 0:
        np.testing.assert_array_equal(root, whole)
    else:
        assert root is None
