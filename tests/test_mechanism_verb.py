"""`mpm mechanism`: constants in both conventions with their units, what is checked, what saturation takes; of cases and of files."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from mpm.case.case import load_case
from mpm.cli import main
from mpm.guide.mechanism import mechanism_sheet
from mpm.physics.rates import Arrhenius, Dependence, Law
from mpm.physics.reaction import GasReaction
from mpm.plain import plain
from mpm.report.chemistry import mechanism_report
from mpm.report.rateunits import peculiar_orders, units_of
from mpm.screen import screen
from mpm.units import parse

from .cases import zone
from .general import law, pair_on_two_places, with_mechanism

N = 6.92e-8


def printed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["mechanism", *arguments]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("gases", "sites", "per_area", "per_site"),
    [
        ({"A": 1.0}, {"*": 1.0}, "m/s", "m^3/mol/s"),
        ({}, {"*": 1.0}, "mol/m^2/s", "1/s"),
        ({}, {"*": 2.0}, "mol/m^2/s", "m^2/mol/s"),
        ({"A": 1.0}, {"*": 2.0}, "m/s", "m^5/mol^2/s"),
        ({"A": 0.5, "B": 1.0}, {}, "m^2.5/mol^0.5/s", "m^2.5/mol^0.5/s"),
    ],
)
def test_units_follow_from_orders(
    gases: dict[str, float], sites: dict[str, float], per_area: str, per_site: str
) -> None:
    """Fails when a unit is not that of r/(prod C^eta prod theta^mu), or of the same with amounts of sites."""
    one = law(1.0, gases, sites)
    assert units_of(one, on_surface=True) == (per_area, per_site)
    assert parse(f"1 {per_area}", per_area) == 1.0


def test_units_in_the_gas() -> None:
    """Fails when a constant of the gas has the unit of another order."""
    for unit, order in {"1/s": 1.0, "m^3/mol/s": 2.0, "mol/m^3/s": 0.0}.items():
        assert units_of(law(1.0, {"A": order}, {}), on_surface=False)[0] == unit


def test_both_conventions_and_both_ways() -> None:
    """Fails when a constant per site is not that per area over the places to the power of the orders, K not the ratio of both ways, or a
    group on two places counts as one on one."""
    m = pair_on_two_places()
    whole = replace(m.surface_reactions[0], backward=law(3.0, {}, {"AA": 1.0}))
    report = mechanism_report(
        with_mechanism(zone(), replace(m, surface_reactions=(whole, *m.surface_reactions[1:])))
    )
    split, wide = report["reactions"]["split"], report["reactions"]["whole"]
    assert split["forward"]["per_site"] == pytest.approx(2.0 / N**2)
    assert split["equilibrium_constant"] == 2.0 and split["equilibrium_constant_unit"] == "m^3/mol"
    assert wide["backward"]["per_site"] == pytest.approx(3.0 / (N / 2.0))
    assert wide["backward"]["per_site_unit"] == "1/s"
    assert {r["missing"] == {} for r in report["reactions"].values()} == {True}


def test_what_does_not_balance_is_said() -> None:
    """Fails when an atom or a place lost in a reaction is not reported."""
    m = pair_on_two_places()
    broken = replace(m.surface_reactions[0], nu_site={"*": -1.0, "AA": 1.0})
    broken = replace(broken, nu_gas={"A2": -2.0})
    report = mechanism_report(with_mechanism(zone(), replace(m, surface_reactions=(broken,))))
    assert report["reactions"]["whole"]["missing"] == {"A": -2.0, "places": 1.0}


def test_a_general_mechanism_on_the_screen(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when the way back, an order, a dependence on coverages or a gas reaction of broken order is not shown with its unit."""
    m = pair_on_two_places()
    bent = replace(m.surface_reactions[1].forward, coverage={"A": Dependence(a=-1.0, m=0.5, E=6e4)})
    gas = GasReaction(
        key="split_up",
        equation="A3 -> 1.5 A2",
        forward=Law(constant=Arrhenius(3.0), gas_orders={"A3": 0.5}),
        nu_gas={"A3": -1.0, "A2": 1.5},
    )
    m = replace(m, surface_reactions=(replace(m.surface_reactions[1], forward=bent),), gas_reactions=(gas,))
    mechanism_sheet(plain(mechanism_report(with_mechanism(zone(), m)))).print(screen())
    text = " ".join(capsys.readouterr().out.split())
    assert "rate constant there 2 m/s" in text and "rate constant back 1 mol/m^2/s" in text
    assert "times 10^(-1 theta) theta^0.5 exp(-60 kJ/mol theta/(R T))" in text
    assert "order 1 in A2, 2 in *" in text and "AA: places 2" in text
    assert "rate constant 3 mol^0.5/m^1.5/s" in text
    assert peculiar_orders(m.surface_reactions[0]) == "order 2 in *; back: order 2 in A"


def test_a_case_says_what_saturates(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when TMA does not take 1 molecule per place, 99 % of it within ln 100 lifetimes, or constants are not those of the thesis."""
    report = json.loads(printed(["single_cycle", "--json"], capsys))
    tma = report["precursors"]["tma"]
    assert tma["molecules_per_place"] == 1.0 and report["precursors"]["water"]["molecules_per_place"] == 1.5
    lifetime = N / (0.9 * tma["concentration"])
    assert tma["seconds"] == pytest.approx(math.log(100.0) * lifetime, rel=1e-5)
    forward = report["reactions"]["tma"]["forward"]
    assert (forward["per_area"], forward["per_area_unit"]) == (pytest.approx(0.9), "m/s")
    assert forward["per_site"] == pytest.approx(0.9 / N)
    assert report["reactions"]["cvd"]["forward"]["in_gas"] == pytest.approx(1e-3)


def test_a_temperature_of_ones_own(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when --temperature is not that at which constants are given: 0.9 m/s sqrt(T/473 K)."""
    report = json.loads(printed(["alumina", "--json", "--temperature", "200 degC"], capsys))
    assert report["temperature"] == 473.15
    assert report["reactions"]["tma"]["forward"]["per_area"] == pytest.approx(0.9 * math.sqrt(473.15 / 473.0))


def test_the_file_that_is_written_is_the_same_mechanism(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a mechanism file written by -o reads back as another mechanism, or replaces a file."""
    path = tmp_path / "mine.toml"
    printed(["single_zone", "--set", "chemistry.reaction.tma.A=2 m/s", "-o", str(path)], capsys)
    back = zone({"chemistry.mechanism": str(path)})
    assert back.mechanism == zone({"chemistry.reaction.tma.A": "2 m/s"}).mechanism
    report = json.loads(printed([str(path), "--set", "reaction.tma.A=3 m/s", "--json"], capsys))
    assert report["reactions"]["tma"]["forward"]["per_area"] == pytest.approx(3.0)
    before = path.read_text()
    assert main(["mechanism", "alumina", "-o", str(path)]) == 2
    assert path.read_text() == before and "there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["alumine"], "did you mean alumina"),
        (["alumina", "--temperature", "473"], "--temperature: found '473' (no unit)"),
        (["alumina", "--temperature", "0 K"], "not above 0 K"),
        (["alumina", "--set", "chemistry.reaction.tma.A=3 kg"], "chemistry.reaction.tma.A"),
        (["alumina", "--phase", "none"], "chemistry.phase"),
        (["."], "a directory"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when bad input ends in anything but status 2 and one line that says what."""
    assert main(["mechanism", *arguments]) == 2
    message = capsys.readouterr().err.strip()
    assert said in message and "\n" not in message


def test_a_case_that_is_no_surface(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Fails when a case without solids that react is asked for its places."""
    case = load_case(
        "single_zone",
        {
            "material.glass_beads.surface_to_volume": "0 1/m",
            "material.sintered_powder.surface_to_volume": "0 1/m",
        },
    )
    path = tmp_path / "bare.toml"
    path.write_text(case.to_toml())
    report = json.loads(printed([str(path), "--json"], capsys))
    assert "site_density" not in report and "per_site" not in report["reactions"]["tma"]["forward"]
    assert "0.9 m/s" in printed([str(path)], capsys)


CANTERA = ["ptcombust.yaml", "--phase", "Pt_surf", "--set", "gas_reactions=false", "--temperature", "900 K"]


def test_a_file_of_cantera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when constants per site differ from Cantera's by more than 1e-9, heats of reaction by more than 1 J/mol, the places are not
    those of the phase, or the mechanism file written by -o has other constants."""
    ct = pytest.importorskip("cantera")
    report = json.loads(printed([*CANTERA, "--json"], capsys))
    surface = ct.Interface("ptcombust.yaml", "Pt_surf")
    surface.TP = surface.adjacent["gas"].TP = 900.0, ct.one_atm
    surface.coverages = {"PT(S)": 1.0}  # where no constant depends on the coverage
    assert report["site_density"] == pytest.approx(surface.site_density * 1e3)
    theirs = zip(surface.reactions(), surface.forward_rate_constants, surface.delta_enthalpy, strict=True)
    for own, (reaction, constant, heat) in zip(report["reactions"].values(), theirs, strict=True):
        kmol = 1e3 ** reaction.rate_coeff_units.dimension("quantity")
        assert own["forward"]["per_site"] == pytest.approx(constant * kmol, rel=1e-9), own["equation"]
        assert own["heat"] == pytest.approx(heat / 1e3, abs=1.0)
    path = tmp_path / "pt.toml"
    printed([*CANTERA, "-o", str(path)], capsys)
    density = f"material.glass_beads.site_density={report['site_density']!r} mol/m^2"
    back = json.loads(printed([str(path), "--json", "--temperature", "900 K", "--set", density], capsys))
    for key, reaction in report["reactions"].items():
        for way in ("forward", "backward"):
            expected = reaction.get(way, {}).get("per_site")
            assert back["reactions"][key].get(way, {}).get("per_site") == pytest.approx(expected)
