"""scripts/conventions.py, which runs every combination of the switches: that it has them all, and that it can find a fault."""

import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from mpm.case.conventions import conventions_of, switches
from mpm.errors import ConvergenceError
from mpm.reactor.reactor import Reactor

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import conventions as script  # noqa: E402

from .test_convention_runs import OPTIONS, draws_in  # noqa: E402

ONE = {name: values[-1] for name, values in OPTIONS.items()}


def test_it_has_every_combination_once() -> None:
    """Fails when a switch or a value of it is missing, or a combination comes twice, or is not what a case of it is."""
    assert OPTIONS == script.VALUES
    every = script.combinations()
    assert len({tuple(one.values()) for one in every}) == len(every) == 288
    for kind in script.KINDS:
        for fidelity in script.TIMES:
            case = script.case_of(kind, fidelity, ONE)
            assert switches(case) == ONE and conventions_of(case)["preset"] == "mpm"
            assert case.fidelity == fidelity and case.geometry.cells < 500


@pytest.mark.parametrize("fidelity", list(script.TIMES))
def test_each_case_is_what_its_name_says(fidelity: str) -> None:
    """Fails when the outlet that draws back does not, nothing reacts between two precursors, or the heated strip is not."""
    reactor = Reactor(script.case_of("an outlet that draws back", fidelity, ONE))
    reactor.run(progress=False)
    assert draws_in(reactor)
    assert script.case_of("both precursors", fidelity, ONE).mechanism.gas_reactions
    assert script.case_of("heated", fidelity, ONE).energy is not None


@pytest.mark.parametrize("name", [one.name for one in fields(script.Worst)])
def test_a_breach_of_any_bound_is_a_failure(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a run that is 1e-8 out of any of its bounds is passed over, or the table of the document is written all the same."""
    written: list[Any] = []
    monkeypatch.setattr(script, "write_between", lambda *given: written.append(given))
    monkeypatch.setattr(script, "KINDS", {"zone": script.KINDS["zone"]})
    monkeypatch.setattr(script, "combinations", lambda: [ONE])
    assert script.main([]) == 0
    assert "| 1 | 0 |" in capsys.readouterr().out
    assert len(written) == 1
    found = script.state
    monkeypatch.setattr(script, "state", lambda reactor: replace(found(reactor), **{name: 1e-8}))
    assert script.main([]) == 1
    assert "| 1 | 1 |" in capsys.readouterr().out
    assert len(written) == 1


def test_a_run_that_ends_in_an_error_is_a_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a combination that does not run counts as one that holds, or ends the script."""

    def run(case: Any) -> Any:
        raise ConvergenceError("gave up")

    monkeypatch.setattr(script, "run", run)
    assert script.main(["--fidelity", "steady", "--some", "2"]) == 1
    assert capsys.readouterr().out.count("gave up") == 2 * len(script.KINDS)


def test_a_number_that_is_none_is_infinitely_wrong() -> None:
    """Fails when NaN in a concentration or a coverage passes for a bound that is kept, as comparisons with it do."""
    for spoil in ("concentration", "theta"):
        reactor = Reactor(script.case_of("zone", "averaged", ONE))
        reactor.run(progress=False)
        assert script.state(reactor).holds
        holder = reactor.system.transport if spoil == "concentration" else reactor.system.coverage
        getattr(holder, spoil)[0, 0] = float("nan")
        assert not script.state(reactor).holds
