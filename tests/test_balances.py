"""A run that is out of balance does not end as done, whatever its fidelity, and keeps its last good state."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.cli import main
from mpm.errors import BalanceError
from mpm.output.directory import RunDirectory
from mpm.reactor.reactor import Reactor
from mpm.report.balances import worst_balance
from mpm.report.records import Totals
from mpm.transport.ledger import Ledger
from mpm.transport.ports import Ports

from .cases import CASES, MPI, SHORT, TINY, assert_same_numbers, physical_numbers, zone


def lose_methane(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    """From now on the ledger misses this share of the methane that leaves."""
    book = Ledger.book

    def miscounted(self: Ledger, ports: Ports, *arguments: Any) -> None:
        before = self.passed.out
        book(self, ports, *arguments)
        methane = ports.names.index("CH4")
        self.passed.out[:, methane] -= share * (self.passed.out - before)[:, methane]

    monkeypatch.setattr(Ledger, "book", miscounted)


def settings(changes: dict[str, Any]) -> list[str]:
    return [part for key, value in changes.items() for part in ("--set", f"{key}={json.dumps(value)}")]


@pytest.mark.parametrize("fidelity", ["steady", "averaged", "resolved"])
def test_a_run_out_of_balance_fails(
    fidelity: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a run that loses half of the methane that leaves ends otherwise than with exit 3, one line that says of what and how
    much, and a summary that says failed; `--resume` must not turn it into a finished one."""
    lose_methane(monkeypatch, 0.5)
    changes = {**TINY, **SHORT, "fidelity": fidelity, "time.end": "0.5 s"}
    arguments = [
        "run",
        str(CASES / "single_zone.toml"),
        "-o",
        str(tmp_path / "run"),
        "-q",
        *settings(changes),
    ]
    for again in ([], ["--resume"]):
        assert main([*arguments, *again]) == 3
        *before, message = capsys.readouterr().err.strip().splitlines()
        assert all("begins anew" in line for line in before) and len(before) <= len(again)
        assert "balance of " in message and " off by " in message
        summary = json.loads((tmp_path / "run" / "summary.json").read_text())
        assert summary["status"] == "failed"
        assert all(np.isfinite(v) for v in physical_numbers(summary).values())
    assert "balance of " in (tmp_path / "run" / "run.log").read_text()


def test_less_than_the_limit_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the limit of 1e-6 is not that."""
    lose_methane(monkeypatch, 5e-7)
    result = Reactor(zone({"fidelity": "steady"}, TINY), MPI.COMM_SELF).run()
    assert result.summary["species"]["CH4"]["balance_error"] == pytest.approx(5e-7, rel=1e-3)


@pytest.mark.parallel
def test_the_last_state_in_balance_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Fails when a state out of balance replaces the restart state, or when a resumed run without the fault differs from one that never
    had it."""
    case = zone({**SHORT, "time.end": "0.5 s", "output.checkpoint": "1 us"}, TINY)
    undisturbed = Reactor(case).run()
    good: list[float] = []

    def spoil(reactor: Reactor) -> None:
        if reactor.time > 0.2 and not good:
            good.append(reactor.time)
            lose_methane(monkeypatch, 0.5)

    with pytest.raises(BalanceError, match="balance of "):
        Reactor(case).run(tmp_path / "run", callback=spoil)
    monkeypatch.undo()
    state = RunDirectory(tmp_path / "run").read_checkpoint()
    assert state is not None and state[1]["time"] >= good[0]
    resumed = Reactor(case).run(tmp_path / "run", resume=True)
    assert resumed.summary["status"] == "done"
    assert_same_numbers(undisturbed.summary, resumed.summary, 1e-9)


def test_a_balance_that_is_not_a_number_is_the_worst() -> None:
    """Fails when NaN passes for a small error."""
    reactor = Reactor(zone(SHORT, TINY), MPI.COMM_SELF)
    totals = reactor.totals()
    spoilt = Totals(**{**vars(totals), "sites": np.full_like(totals.sites, np.nan)})
    assert worst_balance(reactor.case, spoilt)[0] in (
        "sites",
        "element Al",
        "element C",
        "element H",
        "element O",
    )
    assert not worst_balance(reactor.case, spoilt)[1] <= 1e-6
