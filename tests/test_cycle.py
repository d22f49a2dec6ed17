"""A full cycle on a coarse mesh: its parasitic CVD, its balances, the case scripts, and a mechanism that is not alumina."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.case.case import Case, load_case
from mpm.reactor.reactor import Reactor, Result

from .cases import COARSE

ROOT = Path(__file__).parents[1]
STEPS = {**COARSE, "time.step": "50 ms"}
TMA, WATER = "geometry.inlet.tma.mass_fractions.TMA", "geometry.inlet.water.mass_fractions.H2O"


def run(**changes: Any) -> Result:
    return Reactor(load_case("single_cycle", {**STEPS, "output.every": "0.5 s", **changes})).run()


def test_stoichiometric_doses_and_a_delay_keep_cvd_low() -> None:
    """At the port width that makes the pair 2e-4/7.5e-5 saturating (2.2 mm, TMA dose ratio 0.98): a tenth of the CVD of Y = 1e-3/1e-3
    or less, a start-up spike without delay, a tenth of it with 15 s.

    Fails when the CVD rate does not follow the doses, when a delayed inlet doses too early, or when a balance opens; sites on the
    solids that enter, leave and stay count in the balance of the elements. Film grows by half a formula unit per site that passes.
    """
    narrow = {f"geometry.inlet.{name}.width": "2.2 mm" for name in ("purge1", "tma", "purge2", "water")}
    plain = run(**narrow, **{"time.end": "60 s"})
    delayed = run(**narrow, **{"time.end": "60 s", "geometry.inlet.water.start": "15 s"})
    rich = run(**narrow, **{"time.end": "30 s", TMA: 1e-3, WATER: 1e-3})
    rates = {"plain": plain.history["cvd.rate_mean"], "delayed": delayed.history["cvd.rate_mean"]}
    assert (
        rich.history["cvd.rate_mean"][-1]
        > 10.0 * np.interp(30.0, plain.history["time"], rates["plain"])
        > 0.0
    )
    assert rates["plain"].max() > 1.5 * rates["plain"][-1]
    assert rates["delayed"].max() < 0.2 * rates["plain"].max()
    assert np.all(rates["delayed"][delayed.history["time"] <= 15.0] == 0.0)
    for result in (plain, rich, delayed):
        summary = result.summary
        assert set(summary["elements"]) == {"Al", "C", "H", "O"}
        assert max(entry["balance_error"] for entry in summary["elements"].values()) < 1e-9
        assert max(entry["balance_error"] for entry in summary["species"].values()) < 1e-9
        assert summary["sites"]["balance_error"] < 1e-9
        assert summary["cvd"]["total"] == pytest.approx(
            sum(summary["cvd"]["total_in_zone"].values()), rel=1e-12
        )
        assert 0.0 < summary["contamination"]["zone1"]["H2O"] < 1.0
        film = summary["film"]["Al2O3"]
        assert film["thickness"] == pytest.approx(film["per_area"] * 0.102 / 3000.0)
    assert 0.85 < plain.summary["film"]["Al2O3"]["per_area"] / (0.5 * 6.92e-8) < 1.0


def coarse_file(folder: Path, name: str) -> Path:
    path = folder / f"{name}.toml"
    case = load_case(name, {**STEPS, "time.end": "2 s", "output.every": "1 s"})
    path.write_text(case.to_toml(), encoding="utf-8")
    return path


@pytest.mark.parametrize(("script", "ranks"), [("single_zone", 1), ("single_cycle", 2)])
def test_case_scripts_run(script: str, ranks: int, tmp_path: Path, mpirun: Any) -> None:
    """The scripts of cases/ run as they are, alone and under mpirun, and print and write what they promise."""
    starter = mpirun(ranks) if ranks > 1 else [sys.executable]
    command = [*starter, str(ROOT / "cases" / f"{script}.py"), str(coarse_file(tmp_path, script))]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(" s   ") == 3  # one line per output time, from one rank
    directory = next((tmp_path / "results").iterdir())
    assert (directory / "summary.json").exists()


MECHANISM = """
name = "zinc titanate"

[species.TiCl4]
molar_mass = "189.68 g/mol"
[species.DEZ]
formula = "Zn(C2H5)2"
molar_mass = "123.50 g/mol"
[species.H2O]
molar_mass = "18.02 g/mol"
[species.HCl]
molar_mass = "36.46 g/mol"
[species.C2H6]
molar_mass = "30.07 g/mol"
[species."Ti(OH)4"]
molar_mass = "115.90 g/mol"

[site.OH]
[site.OTiCl3]
[site.OZnC2H5]

[film.TiO2]
molar_mass = "79.87 g/mol"
density = "3900 kg/m^3"
[film.ZnO]
molar_mass = "81.38 g/mol"

[reaction.titanium]
equation = "OH + TiCl4 -> HCl + OTiCl3"
sticking = 0.006
[reaction.zinc]
equation = "OH + DEZ -> C2H6 + OZnC2H5"
sticking = 0.007
[reaction.titania]
equation = "OTiCl3 + 2 H2O -> 3 HCl + TiO2 + OH"
sticking = 0.01
[reaction.zinc_oxide]
equation = "OZnC2H5 + H2O -> C2H6 + ZnO + OH"
sticking = 0.02
[reaction.cvd]
equation = "TiCl4 + 4 H2O -> Ti(OH)4 + 4 HCl"
A = "2.0 m^3/kmol/s"
"""


def three_precursors(folder: Path) -> Case:
    """A strip of three zones that doses TiCl4, diethylzinc and water, from a user's own file."""
    (folder / "titanate.toml").write_text(MECHANISM, encoding="utf-8")
    layers = [
        {"name": "plenum", "height": "5 mm", "cells": 3},
        {"name": "frit", "height": "1.59 mm", "cells": 2, "material": "sintered_powder"},
        {"name": "bed", "height": "3 mm", "cells": 3, "material": "glass_beads", "moving": True},
        {"name": "headspace", "height": "6 mm", "cells": 4},
    ]
    doses = {"titanium": {"TiCl4": 1e-3}, "zinc": {"DEZ": 5e-4}, "water": {"H2O": 2e-4}}
    places = [(name, f"{20 + 40 * k} mm", y) for k, (name, y) in enumerate(doses.items())]
    inlets = [
        {"name": n, "center": x, "width": "4 mm", "velocity": "3.5 cm/s", "mass_fractions": y}
        for n, x, y in places
    ]
    outlets = [{"name": f"out_{n}", "center": x, "width": "8 mm"} for n, x, _ in places]
    return load_case(
        {
            "title": "Zinc titanate",
            "geometry": {
                "length": "120 mm",
                "cell_width": "2 mm",
                "layer": layers,
                "inlet": inlets,
                "outlet": outlets,
            },
            "gas": {"viscosity": "1.72e-5 Pa s"},
            "chemistry": {"mechanism": str(folder / "titanate.toml")},
            "time": {"end": "12 s", "step": "50 ms"},
            "output": {"every": "1 s"},
        }
    )


def test_a_mechanism_of_ones_own(tmp_path: Path) -> None:
    """Three precursors, three states of the sites, two films, another CVD reaction: data alone, no code.

    Fails when anything in transport, kinetics, bed or diagnostics knows alumina, two precursors or two states.
    """
    result = Reactor(three_precursors(tmp_path)).run(tmp_path / "run")
    summary = result.summary
    assert set(summary["elements"]) == {"C", "Cl", "H", "O", "Ti", "Zn"}
    assert max(entry["balance_error"] for entry in summary["elements"].values()) < 1e-9
    assert max(entry["balance_error"] for entry in summary["species"].values()) < 1e-9
    assert summary["sites"]["balance_error"] < 1e-9
    assert summary["film"]["TiO2"]["amount"] > 0.0 and summary["film"]["ZnO"]["amount"] > 0.0
    assert (
        summary["film"]["TiO2"]["thickness"] > 0.0 and "thickness" not in summary["film"]["ZnO"]
    )  # it has no density
    assert summary["cvd"]["total"] > 0.0
    shares = [result.coverage("bed", site) for site in ("OH", "OTiCl3", "OZnC2H5")]
    assert np.allclose(sum(shares), 1.0, atol=1e-12) and min(s.min() for s in shares) >= 0.0
    assert set(summary["titration"]) == {"titanium", "zinc", "water"}
    assert set(summary["contamination"]["zone1"]) == {"DEZ", "H2O"}
    shutil.rmtree(tmp_path / "run")
