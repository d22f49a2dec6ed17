"""Every slip in a mechanism is one line that names the reaction (or substance), what was found, and what to type in its place."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from mpm.case.case import load_case
from mpm.cli import main
from mpm.errors import InputError

from .test_rate_laws import with_reaction

SLIPS = tomllib.loads(Path(__file__).with_name("mechanism_slips.toml").read_text(encoding="utf-8"))["slip"]


@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_is_told(slip: dict[str, Any]) -> None:
    """Fails when a mechanism that means nothing is accepted, or a word of its line changes without anybody reading it."""
    beside = slip.get("beside", {})
    overrides = {key: value for key, value in beside.items() if "." in key}
    tables = {key: value for key, value in beside.items() if "." not in key}
    with pytest.raises(InputError) as caught:
        with_reaction(slip["reaction"], overrides, **tables)
    assert str(caught.value) == f"case: chemistry.{slip['line']}"


def test_sticking_is_held_to_all_temperatures_of_a_case() -> None:
    """Fails when a sticking coefficient that passes 1 at a wall's temperature alone is accepted."""
    hot: dict[str, Any] = {"chemistry.reaction.tma.sticking": 1e-3, "chemistry.reaction.tma.b": 1.0}
    hot["chemistry.reaction.tma.reference_temperature"] = "1 K"
    load_case("single_zone", {**hot, "energy": {}})
    with pytest.raises(InputError, match=r"sticking coefficient of 1[.]1 at 1100 K"):
        load_case("single_zone", {**hot, "energy": {}, "geometry.bed_temperature": "1100 K"})


@pytest.mark.parametrize("verb", ["check", "run"])
def test_a_wrong_mechanism_file_ends_with_2_and_writes_nothing(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when the line is not the only one, the exit status is another, or a directory is left behind."""
    monkeypatch.chdir(tmp_path)
    text = '[species.A]\nmolar_mass = "20 g/mol"\nelements = {}\n[site."*"]\n[site."A*"]\nelements = {}\n'
    one = '[reaction.on]\nequation = "A + * <=> A*"\nA = "1 m/s"\n'
    for slip, line in (
        (
            one,
            "case.toml: chemistry.reaction.on.equation: found 'A + * <=> A*', and no enthalpy and entropy of A, ",
        ),
        (
            one + one,
            "own.toml: found a TOML syntax error (Cannot declare ('reaction', 'on') twice (at line 10, column 13))",
        ),
        (one.replace("A*", "B"), "case.toml: chemistry.reaction.on.equation: found 'B' in 'A + * <=> B'"),
    ):
        Path("own.toml").write_text(text + slip)
        Path("case.toml").write_text(
            '[geometry]\nbase = "single_zone"\n[chemistry]\nmechanism = "own.toml"\n'
        )
        assert main([verb, "case.toml"]) == 2
        said = capsys.readouterr()
        assert line in said.err and said.err.strip().count("\n") == 0
        assert sorted(path.name for path in tmp_path.iterdir()) == ["case.toml", "own.toml"]
