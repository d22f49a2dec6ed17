"""What `mpm check` says of a case: values with units and origins, what is silent otherwise, each thing once."""

import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest

from mpm.advice.checks import check_case
from mpm.advice.engineering import sites_per_square_nanometre, standard_flow
from mpm.advice.notes import notes
from mpm.advice.screen import print_report
from mpm.case.case import Case, load_case
from mpm.case.marks import print_full
from mpm.cli import main
from mpm.screen import print_steps

from .test_screen import text_of

OWN = {
    "geometry": {
        "length": "100 mm",
        "layer": [
            {"name": "below", "height": "5 mm", "cells": 5},
            {"name": "bed", "height": "2 mm", "cells": 5, "material": "sand", "moving": True},
            {"name": "above", "height": "5 mm", "cells": 5},
        ],
        "inlet": [{"name": "in", "center": "50 mm", "width": "4 mm", "mass_fractions": {"TMA": 1e-4}}],
        "outlet": [{"name": "out", "center": "50 mm", "width": "4 mm"}],
    },
    "material": {"sand": {"porosity": 0.4, "permeability": "5 um^2", "surface_to_volume": "5e4 1/m"}},
    "gas": {"temperature": "400 K"},
}


def words(case: Case, width: int = 100) -> str:
    """The screen of a case, in one line."""
    return " ".join(text_of(width, print_report, case, check_case(case)).split())


def test_defaults_are_marked() -> None:
    """Fails when a value that nobody typed and that decides the answer is shown as if it had been typed, or the other way round."""
    text = words(load_case(OWN))
    for part in (
        "periodic: gas leaving at the right comes back at the left (default)",
        "fresh, at the left (default)",
        "columns of 0.34 mm (default)",
        "6.92e-8 mol/m^2 (default)",
        "N2 (default)",
        "temperature 400 K pressure 101325 Pa (default) density",
        "3.5 cm/s (default), ",
        "from 0 s on (default)",
        "mean velocity of the bed 1.3 cm/s (default)",
        "averaged (default): the mean of the vibration cycle, 0 s to 20 s",
        "end 20 s (default)",
        "porosity 0.4 permeability 5 um^2 tortuosity",
        "tortuosity factor 1.58114 (worked out)",
        "Marks not typed in the case but taken from (default) the program, ",
    ):
        assert part in text, part
    own = load_case(OWN, {"geometry.periodic": False, "motion.bed_velocity": "1.3 cm/s"})
    assert "closed by walls length" not in words(own) and "ends closed by walls solids" in words(own)
    assert "mean velocity of the bed 1.3 cm/s straight" in words(own)
    built_in = words(load_case("single_zone"))
    assert "porosity 0.46 (built-in)" in built_in and "length 139.7 mm (base)" in built_in


def test_a_resolved_case_has_no_marks(tmp_path: Path) -> None:
    """Fails when the case that a run has written, in which every key stands, is said to leave something to defaults."""
    (tmp_path / "case.toml").write_text(load_case(OWN).to_toml(), encoding="utf-8")
    text = words(load_case(tmp_path / "case.toml"))
    assert "(default)" not in text and "(base)" not in text and "Marks" not in text


def test_what_is_silent_is_said() -> None:
    """Fails when check keeps quiet about sites, diffusivity, mole fraction, sccm, Knudsen number or what is missing of the powder."""
    text = words(load_case(OWN))
    for part in (
        "0.0417 sites per nm^2",
        "a hundredth of one site per 24 square angstrom, 4.17 per nm^2 (6.92e-6 mol/m^2)",
        "worked out: scaled from 2.88e-5 m^2/s in N2 at 473 K",
        "mole fraction 3.886e-5",
        "5736 sccm/m",
        "at 0 degC and 101325 Pa",
        "Knudsen number of the pores",
        "material.sand.density and material.sand.particle_diameter are missing",
        "molecules per passing site",
    ):
        assert part in text, part
    still = words(load_case(OWN, {"motion.bed_velocity": "0 m/s"}))
    assert "layer bed does not move (motion.bed_velocity is 0 cm/s)" in still and "molecules per" not in still
    assert "solids come in" not in still
    fixed = load_case("single_zone", {"geometry.layer.bed.moving": False})
    assert "no layer moves" in notes(fixed)[0] and "geometry.layer.bed.moving" in notes(fixed)[0]


def test_the_numbers_of_an_engineer_are_those_of_the_report() -> None:
    """Fails when a number on the screen is not that of the report in the unit beside it."""
    case = load_case("single_zone")
    report, text = check_case(case), words(case)
    bed, tma = report["bed"], report["inlets"]["tma"]
    for label, value, unit in (
        ("time of the bed in the strip", bed["residence_time"], " s"),
        ("gas rising through the bed, at most", bed["gas_velocity"] * 1e2, " cm/s"),
        ("minimum fluidisation, Wen and Yu", bed["minimum_fluidisation_wen_yu"] * 1e2, " cm/s"),
        ("pressure drop of the bed", bed["pressure_drop"], " Pa"),
        ("dose", tma["excess_number"], " molecules per passing site"),
    ):
        shown = re.search(rf" {label} (\S+){unit}", text)
        assert shown is not None and float(shown[1]) == pytest.approx(value, rel=2e-3), label


def test_species_that_diffuse_alike_share_a_line() -> None:
    """Fails when one diffusivity of all species names them, or one of several does not."""
    together = words(load_case("single_cycle"))
    assert " diffusivity 2.88e-5 m^2/s" in together and "diffusivity of" not in together
    apart = words(load_case("single_cycle", {"gas.diffusivity": {"TMA": "1e-5 m^2/s"}}))
    assert (
        " diffusivity of TMA 1e-5 m^2/s" in apart
        and " diffusivity of H2O, CH4, Al(OH)3 2.88e-5 m^2/s" in apart
    )


def test_the_hundredth_and_the_standard_flow() -> None:
    """n_s N_A = 0.0417 per nm2 against 1/0.24 per nm2, and q T0 p/(T p0): 4 mm at 3.5 cm/s and 473 K are 4.85 standard litres a minute."""
    assert sites_per_square_nanometre(6.92e-8) == pytest.approx(0.01 / 0.24, rel=2e-3)
    assert standard_flow(1.4e-4, temperature=473.0, pressure=101325.0) * 6e7 == pytest.approx(
        4851.0, rel=1e-3
    )
    assert standard_flow(1.0, temperature=273.15, pressure=50662.5) == 0.5


def test_json_has_the_same_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when what the screen says is missing from --json."""
    assert main(["check", "single_zone", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["strip"]["ends"] == "periodic" and report["strip"]["bed_direction"] == "right"
    assert report["sites_per_nm2"]["bed"] == pytest.approx(0.04167, rel=1e-3)
    tma = report["inlets"]["tma"]
    assert tma["mole_fractions"]["TMA"] == pytest.approx(2e-4 * 28.01 / 72.09, rel=1e-3)
    assert (
        tma["sccm_per_metre"] == pytest.approx(6e7 * tma["standard_flow"]) == pytest.approx(4851.0, rel=1e-3)
    )
    assert (
        report["origins"]["geometry.periodic"] == "base"
        and report["origins"]["geometry.bed_inflow"] == "default"
    )
    assert len(report["notes"]) == 1 and "\u00a0" not in json.dumps(report, ensure_ascii=False)
    assert report["motion"]["vibration_enters"] is False


@pytest.mark.parametrize("fidelity", ["averaged", "steady"])
def test_a_vibration_that_does_not_enter_is_said_once(fidelity: str) -> None:
    """Fails when gamma is shown as if it counted, or it is said in the heading and again among the keys without effect."""
    for changes, where in (
        ({}, "Motion (of which fidelity"),
        ({"motion.gamma": 0.4}, "motion.frequency, motion.gamma: a run with"),
    ):
        text = words(
            load_case("single_zone", {"fidelity": fidelity, "motion.frequency": "20 Hz", **changes}), 300
        )
        said = [
            part
            for part in ("Motion (of which fidelity", "motion.frequency, motion.gamma: a run with")
            if part in text
        ]
        assert said == [where], text
    assert "Motion (" not in words(load_case("single_zone", {"fidelity": "resolved"}))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"material.glass_beads.particle_diameter": "0.4 mm"},
            "layer bed is 3 mm high, 7.5 particles of 400 um",
        ),
        (
            {"geometry.inlet.tma.velocity": "12 cm/s"},
            "times the flow of the inlets below would leave it at rest",
        ),
    ],
)
def test_warnings_explain_themselves(changes: dict[str, Any], text: str) -> None:
    assert not any(text in warning for warning in check_case(load_case("single_zone"))["warnings"])
    assert any(text in warning for warning in check_case(load_case("single_zone", changes))["warnings"])


def test_the_flow_that_the_warning_advises() -> None:
    """Fails when the share of the flow that the warning names still fluidises the bed."""

    def case(share: float) -> Case:
        speed = f"{share * 12.0} cm/s"
        return load_case(
            "single_zone", {"geometry.inlet.tma.velocity": speed, "geometry.inlet.purge.velocity": speed}
        )

    (warning,) = check_case(case(1.0))["warnings"]
    share = float(warning.split("; ")[1].split()[0])
    assert check_case(case(0.98 * share))["warnings"] == [] != check_case(case(1.05 * share))["warnings"]


def test_full_shows_every_key() -> None:
    """Fails when a value of the resolved case, its unit or its origin is missing from --full."""
    text = " ".join(text_of(80, print_full, load_case(OWN)).split())
    for part in (
        "geometry.inlet.in name in (typed) side bottom (default) center 50 mm (typed)",
        "mass_fractions.TMA 1e-4 (typed)",
        "bed_velocity 1.3 cm/s (default)",
        "tortuosity_factor 1.58114 (worked out)",
        "diffusivity.TMA",
        "chemistry.reaction.tma equation OH + TMA -> CH4 + OAl(CH3)2 (built-in)",
    ):
        assert part in text, part


def test_the_next_step_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["check", "single_zone", "--set", "title=a b"]) == 0
    assert "mpm run single_zone --set 'title=a b'" in capsys.readouterr().out.splitlines()[-1]
    command = "mpm run single_zone --set fidelity=resolved --set 'title=a b c d e f'"
    lines = text_of(40, print_steps, [(command, "a run")]).splitlines()
    typed = "\n".join(lines[1:]).replace(" \\\n", " ")  # as a shell reads it
    assert shlex.split(typed, comments=True) == shlex.split(command) and len(lines) > 3


def test_the_case_of_the_readme() -> None:
    """Fails when the first case that a newcomer types ends with a warning that does not say what to do."""
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    text = readme.partition("```toml\n")[2].partition("```")[0]
    for warning in check_case(load_case(tomllib.loads(text)))["warnings"]:
        assert "would leave it at rest" in warning
