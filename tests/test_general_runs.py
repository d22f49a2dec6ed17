"""Coarse runs of mechanisms with any rate law, from the file to the report: numbers by hand, balances, pictures, searches for doses."""

import json
from pathlib import Path

import numpy as np
import pytest

from mpm.advice.doses import doses_of
from mpm.cli import main
from mpm.optimise import Search, optimise, write_points
from mpm.reactor.reactor import Reactor
from mpm.report.dosing import inlet_excess

from .cases import MPI, TINY, zone
from .general import SITTING

GROWING = """
name = "growing"
[species.TMA]
formula = "Al(CH3)3"
molar_mass = "72.09 g/mol"
[site."*"]
elements = {}
[site.idle]
elements = {}
[film.F]
formula = "Al(CH3)3"
[reaction.grows]
equation = "TMA + * -> * + F"
A = "1 mm/s"
"""
"""TMA becomes a film wherever it meets the surface."""
PAIRS = """
name = "pairs"
[species.TMA]
formula = "Al(CH3)3"
molar_mass = "72.09 g/mol"
[species.X]
formula = "Al2(CH3)6"
molar_mass = "144.18 g/mol"
[site."*"]
elements = {}
[site.wide]
formula = "Al(CH3)3"
sites = 2
[film.F]
formula = "Al(CH3)3"
[reaction.lands]
equation = "TMA + 2 * <=> wide"
A = "2 m/s"
reverse = { A = "1e-5 mol/m^2/s" }
[reaction.turns]
equation = "wide -> 2 * + F"
A = "3 1/s"
[reaction.pairs]
equation = "2 TMA <=> X"
A = "1e3 m^3/mol/s"
equilibrium_constant = "1 m^3/mol"
"""
"""A group on two places that becomes a film by itself, and an equilibrium in the gas."""


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    found = {}
    for name, text in {"sitting": SITTING, "growing": GROWING, "pairs": PAIRS}.items():
        found[name] = str(tmp_path / f"{name}.toml")
        Path(found[name]).write_text(text)
    return found


@pytest.mark.parametrize("name", ["sitting", "growing", "pairs"])
@pytest.mark.parametrize("fidelity", ["steady", "averaged"])
def test_from_the_file_to_the_page(
    name: str, fidelity: str, files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a run, its summary, screen, report page or pictures of such a mechanism end in an exception, or do not balance."""
    changes = {**TINY, "chemistry.mechanism": files[name], "fidelity": fidelity, "time.end": "0.6 s"}
    settings = [part for k, v in {**changes, "time.step": "0.1 s"}.items() for part in ("--set", f"{k}={v}")]
    assert main(["run", "single_zone", "-o", str(tmp_path / "run"), *settings]) == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["status"] == "done"
    assert summary["sites"]["balance_error"] < 1e-9
    assert max(entry["balance_error"] for entry in summary["species"].values()) < 1e-7
    assert max(entry["balance_error"] for entry in summary["elements"].values()) < 1e-9
    assert ("titration" in summary) == (name != "growing")
    assert "cvd" not in summary  # an equilibrium in the gas is none
    assert "TMA" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    said = capsys.readouterr().out
    assert ("leaves the sites as they are" in said) == (name == "growing")
    if fidelity == "averaged":
        assert main(["plot", str(tmp_path / "run")]) == 0
        assert main(["paraview", str(tmp_path / "run")]) == 0


def test_growth_by_hand(files: dict[str, str]) -> None:
    """Fails when what grows without a change of sites is not what the gas has lost, or is more than k C on all of the surface."""
    summary = (
        Reactor(zone({"chemistry.mechanism": files["growing"], "fidelity": "steady"}, TINY), MPI.COMM_SELF)
        .run()
        .summary
    )
    assert summary["film"]["F"]["amount"] == pytest.approx(summary["species"]["TMA"]["reacted"], rel=1e-9)
    assert 0.0 < summary["utilisation"]["tma"] < 1.0


def test_the_leanest_dose_of_a_precursor_that_comes_off_again(files: dict[str, str], tmp_path: Path) -> None:
    """Fails when a search with a reversible precursor does not end at the target, or ends below the feed that could leave so much."""
    case = zone({"chemistry.mechanism": files["sitting"]}, TINY)
    best, best_case, search = optimise(case, target=0.8, limit=30)
    assert best.exits["tma"] == pytest.approx(0.8, abs=2e-3)
    inlet = next(i for i in best_case.geometry.inlets if i.doses)
    concentration = 9000.0 * best_case.feed_concentrations(inlet.mass_fractions)["TMA"]
    assert concentration / (1.0 + concentration) > 0.8
    found = inlet_excess(best_case, inlet)
    assert found is not None and best.ratios["tma"] == pytest.approx(found.dose_ratio)
    write_points(tmp_path, search)
    rows = (tmp_path / "points.csv").read_text().splitlines()
    assert len(rows) == len(search.points) + 1 and len({row.count(",") for row in rows}) == 1


def test_a_dose_ratio_that_does_not_exist_leaves_its_place_empty(
    files: dict[str, str], tmp_path: Path
) -> None:
    """Fails when the table of a search shifts its columns where a point has no dose ratio."""
    case = zone({"chemistry.mechanism": files["sitting"]}, TINY)
    search = Search(case, doses_of(case, 0.5, velocities=False), 0.5, 10.0)
    for share in (1.0, 0.9):
        search.point(np.log([share * dose.start for dose in search.doses]))
    lean = search.points[-1]
    search.points[-1] = type(lean)(**{**vars(lean), "ratios": {}})
    write_points(tmp_path, search)
    head, *_, last = (tmp_path / "points.csv").read_text().splitlines()
    row = dict(zip(head.split(","), last.split(","), strict=True))
    assert row["dose_ratio.tma"] == "" and float(row["excess_number.tma"]) == lean.excess["tma"]
