"""Reports and advice of mechanisms with any rate law: what has no number is left out, and sentences say what is so."""

from pathlib import Path

import numpy as np
import pytest

from mpm.advice.checks import check_case
from mpm.advice.doses import doses_of
from mpm.advice.heat import energy_report
from mpm.case.case import Case
from mpm.cli import main
from mpm.mesh.grid import Grid
from mpm.physics.mechanism import Mechanism
from mpm.physics.rates import Arrhenius, Law
from mpm.physics.reaction import GasReaction
from mpm.physics.substances import Site, Species
from mpm.report.coating import titration
from mpm.report.dosing import inlet_excess, made_sites
from mpm.report.fronts import fronts
from mpm.report.gas import cvd_totals
from mpm.report.records import State, Totals
from mpm.report.verdict import growth_share, percent, verdict

from .cases import TINY, cycle, zone
from .general import SITTING, law, mechanism, surface, with_mechanism
from .test_general_balances import book

TMA = zone().mechanism.get("TMA")


def growing() -> Mechanism:
    """TMA grows a film wherever it meets the surface, whose sites stay as they are."""
    return mechanism(
        surface("growth", {}, law(0.1, {"TMA": 1.0}, {"OH": 1.0}), gases={"TMA": -1.0}, film={"F": 1.0}),
        species=(TMA,),
        sites=(Site("OH", {}),),
    )


def sitting(strength: float = 10.0) -> Mechanism:
    """TMA sits down on OH and comes off again."""
    return mechanism(
        surface(
            "sits",
            {"OH": -1.0, "TMA*": 1.0},
            law(1.0, {"TMA": 1.0}, {"OH": 1.0}),
            law(None, {}, {"TMA*": 1.0}),
            {"TMA": -1.0},
            equilibrium=strength,
        ),
        species=(TMA,),
        sites=(Site("OH", {}), Site("TMA*", {})),
    )


def state_of(case: Case) -> State:
    grid = Grid.from_case(case)
    rows = np.flatnonzero(grid.per_row(lambda solid: solid.surface_to_volume, gas=0.0))
    sites = len(case.mechanism.site_names)
    return State(
        theta=np.full((sites, len(rows), grid.columns), 1.0 / sites),
        reactive_rows=rows,
        cvd=np.zeros(2),
        cvd_max=0.0,
        concentration={"TMA": np.zeros((grid.rows, grid.columns))},
    )


def test_growth_that_leaves_sites_alone() -> None:
    """Fails when a precursor that changes no site ends a report, has a titration, or a dose that saturates."""
    case = with_mechanism(zone({}, TINY), growing())
    assert titration(case, Grid.from_case(case), state_of(case)) == {}
    assert fronts(case, Grid.from_case(case), state_of(case)) == {}
    assert made_sites(case) == []
    numbers = check_case(case)["inlets"]["tma"]
    assert "dose_ratio" not in numbers and "site_lifetime" not in numbers
    assert numbers["excess_number"] > 0.0 and numbers["gas_lifetime"] > 0.0
    assert "TMA leaves the sites as they are" in verdict(case, {"fidelity": "steady"})


def test_what_comes_off_again_is_dosed_for_its_equilibrium() -> None:
    """Fails when the dose ratio of a reversible precursor is not its excess over what its own concentration leaves on the solids."""
    case = with_mechanism(zone({}, TINY), sitting())
    inlet = next(i for i in case.geometry.inlets if i.doses)
    found = inlet_excess(case, inlet)
    concentration = case.feed_concentrations(inlet.mass_fractions)["TMA"]
    stays = 10.0 * concentration / (1.0 + 10.0 * concentration)
    assert found is not None and found.dose_ratio == pytest.approx(found.per_site / stays, rel=1e-5)
    assert titration(case, Grid.from_case(case), state_of(case))["tma"]["exit_mean"] == pytest.approx(0.5)


def gas_reaction(key: str, gases: dict[str, float], back: bool = False) -> GasReaction:
    law = Law(constant=Arrhenius(1.0), gas_orders={n: 1.0 for n, nu in gases.items() if nu < 0})
    return GasReaction(key=key, equation=key, forward=law, backward=law if back else None, nu_gas=gases)


def test_parasitic_growth_is_what_does_not_go_back() -> None:
    """Fails when an equilibrium in the gas counts as parasitic CVD, or two reactions take the same share of a precursor."""
    case = zone({}, TINY)
    reactions = (
        gas_reaction("pair", {"TMA": -2.0, "TMA2": 1.0}, back=True),
        gas_reaction("slow", {"TMA": -1.0, "X": 1.0}),
        gas_reaction("fast", {"TMA": -3.0, "X": 3.0}),
    )
    species = (TMA, Species("TMA2", 0.14, {}), Species("X", 0.07, {}))
    mixed = with_mechanism(
        case,
        Mechanism(
            name="gas", species=species, sites=(), films=(), surface_reactions=(), gas_reactions=reactions
        ),
    )
    totals = Totals(
        **{
            **vars(book(0.0, 0.0, 0.0)),
            "names": ("TMA", "TMA2", "X"),
            "gas": np.array([[0.0, -7.0], [0.0, 1.0], [0.0, 2.0]]),
        }
    )
    numbers = cvd_totals(mixed, totals)
    assert numbers["total"] == 3.0 and numbers["used"] == {"TMA": 7.0}
    summary = {"cvd": numbers, "species": {"TMA": {"fed": 70.0}}}
    assert growth_share(mixed, summary) == pytest.approx(0.1)
    alone = with_mechanism(case, Mechanism(**{**vars(mixed.mechanism), "gas_reactions": reactions[:1]}))
    assert cvd_totals(alone, Totals(**{**vars(totals), "gas": totals.gas[:1]})) == {}


def test_shares_below_nothing() -> None:
    """Fails when a share of -1e-14 is more than none, or one of -5 % "less than 0.001 %"."""
    assert percent(-1e-14) == "0 %"
    assert percent(-0.05) == "-5 %"


def test_a_reaction_without_sites_has_no_rise() -> None:
    """Fails when the rise of an insulated bed is asked of growth that leaves the sites as they are."""
    hot = zone(
        {
            "energy": {},
            "material.glass_beads.conductivity": "1 W/m/K",
            "material.glass_beads.heat_capacity": "800 J/kg/K",
        },
        TINY,
    )
    assert hot.energy is not None
    case = with_mechanism(hot, growing())
    assert energy_report(case, hot.energy)["bed"]["adiabatic_rise"] == {"growth": None}
    assert check_case(case)["energy"]["bed"].get("adiabatic_rise") == {}


@pytest.fixture
def sitting_file(tmp_path: Path) -> str:
    path = tmp_path / "sitting.toml"
    path.write_text(SITTING)
    return str(path)


@pytest.mark.parametrize("target", [0.5, 0.9])
def test_a_search_starts_where_enough_stays(sitting_file: str, target: float) -> None:
    """Fails when the first dose of a reversible precursor is not the leanest that leaves the target on the solids, K C/(1 + K C), and
    feeds that share of what it leaves."""
    case = zone({"chemistry.mechanism": sitting_file}, TINY)
    (dose,) = doses_of(case, target, velocities=False)
    at = case.with_({dose.key: dose.start})
    inlet = next(i for i in at.geometry.inlets if i.doses)
    concentration = 9000.0 * at.feed_concentrations(inlet.mass_fractions)["TMA"]
    found = inlet_excess(at, inlet)
    assert found is not None and found.dose_ratio is not None
    reached = min(concentration / (1.0 + concentration) / target, found.dose_ratio / target)
    assert 1.0 <= reached < 1.03


def test_rates_and_orders_can_be_swept(sitting_file: str) -> None:
    """Fails when a key of the way back, of an equilibrium or of an order cannot be changed by its dotted name."""
    case = zone({"chemistry.mechanism": sitting_file}, TINY)
    slow = case.with_({"chemistry.reaction.sits.reverse.A": "1e3 1/s"}).mechanism.surface_reactions[0]
    assert (
        slow.backward is not None
        and slow.backward.constant == Arrhenius(1e3)
        and slow.backward.per_site == 1.0
    )
    half = case.with_(
        {"chemistry.reaction.sits.orders": {"TMA": 0.5}, "chemistry.reaction.sits.A": "1 m^-0.5*mol^0.5/s"}
    )
    assert half.mechanism.surface_reactions[0].forward.gas_orders == {"TMA": 0.5}
    one = case.with_({"chemistry.reaction.sits.orders.OH": 2.0})
    assert one.mechanism.surface_reactions[0].forward.site_orders == {"OH": 2.0}
    given = case.with_({"chemistry.reaction.sits.equilibrium_constant": "3 m^3/mol"})
    assert given.mechanism.surface_reactions[0].equilibrium == Arrhenius(3.0)


def test_check_says_orders_and_endless_uptake(sitting_file: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when `mpm check` hides a way back, an order that is not 1, or that nothing saturates."""
    settings = {
        "chemistry.mechanism": sitting_file,
        "chemistry.reaction.sits.orders": "{TMA = 2}",
        "chemistry.reaction.sits.A": "1 m^4/mol/s",
        "chemistry.film.F.formula": "Al(CH3)3",
        "chemistry.reaction.grows.equation": "TMA + OH -> OH + F",
        "chemistry.reaction.grows.A": "1 cm/s",
    }
    assert (
        main(["check", "single_zone", *(part for k, v in settings.items() for part in ("--set", f"{k}={v}"))])
        == 0
    )
    text = capsys.readouterr().out
    assert "OH + TMA <=> TMA* (order 2 in TMA; back: order 2 in" not in text
    assert "OH + TMA <=> TMA* (order 2 in TMA)" in text
    assert "molecules per passing site, taken up without end" in text


@pytest.mark.parametrize(
    ("name", "feeds", "sites"),
    [
        ("titania", ("TiCl4", "H2O"), ["OTiCl3", "OH", "OH*HCl"]),
        ("zinc_oxide", ("DEZ", "H2O"), ["OZnC2H5", "OH"]),
        ("alumina_soft", ("TMA", "H2O"), ["OAl(CH3)2", "OAl(CH3)2_slow", "OH", "OH_slow"]),
        ("silicon", ("SiH4", "H2"), ["SiH4*", "H2*"]),
    ],
)
def test_sites_worth_a_map(name: str, feeds: tuple[str, str], sites: list[str]) -> None:
    """Fails when the sites that a product holds down are left out of maps, or what a first-order mechanism shows has changed."""
    inlets = zip(("tma", "water"), feeds, strict=True)
    feed = {f"geometry.inlet.{inlet}.mass_fractions": {gas: 1e-4} for inlet, gas in inlets}
    assert made_sites(cycle({"chemistry.mechanism": name, **feed}, TINY)) == sites
