"""Broken files of every kind end in one line, never in a traceback. `python scripts/fuzz.py` reads 20,000 of them."""

import random
import sys
from pathlib import Path
from typing import Any

import pytest

from mpm.case.case import load_case
from mpm.errors import InputError

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import fuzz

FILES = 500
"""Of each kind."""


@pytest.mark.parametrize("name", fuzz.KINDS)
def test_broken_files_end_in_one_line(name: str, tmp_path: Path) -> None:
    """Fails when a file is neither accepted, with all that check says of it, nor refused by an InputError of one line."""
    fuzz.prepare(tmp_path)
    kind, said = fuzz.KINDS[name], []
    for number in range(FILES):
        content = fuzz.broken(kind, random.Random(f"test {name} {number}"))
        said.append((*fuzz.verdict(kind, content, tmp_path), number))
    assert [entry for entry in said if entry[0] == "failed"] == []
    assert len({text for _, text, _ in said}) > FILES / 4, "the files are not broken in many ways"
    assert sum(status == "accepted" for status, _, _ in said) > FILES / 50, (
        "what lies behind the door is not reached"
    )


@pytest.mark.parametrize("name", fuzz.KINDS)
def test_the_files_that_are_broken_are_valid_before(name: str, tmp_path: Path) -> None:
    """The test above means something only if what it starts from is right."""
    fuzz.prepare(tmp_path)
    kind = fuzz.KINDS[name]
    for seed in kind.seeds:
        status, text = fuzz.verdict(kind, fuzz.example(seed).encode(), tmp_path)
        assert status == "accepted", text


LAYER = {"name": "gas", "height": "1 mm", "cells": 2}


@pytest.mark.parametrize(
    ("changes", "line"),
    [  # one of each kind that the fuzz has found
        ({"geometry": {"base": "single_zone", "layer": [{"name": {}}]}}, "geometry.layer.1.name: found a table"),
        ({"geometry": {"base": "single_zone", "inlet": [{"name": ["tma"]}]}}, "geometry.inlet.1.name: found a list of 1"),
        ({"chemistry": {"mechanism": "a\x00b"}}, "no such file"),
        ({"chemistry": {"mechanism": "a" * 5000}}, "no such file"),
        ({"motion": {"profile": "a\x00b"}}, "embedded null byte"),
        ({"geometry": {"zone": [{"name": "a", "start": "0 m", "end": "inf m"}]}}, "zone.a.end: found 'inf m'"),
        ({"motion": {"gamma": 10**400}}, "motion.gamma: found 1000000"),
        ({"motion": {"gamma": 1e300}}, "of a size from 1e-30 to 1e+30"),
        ({"geometry": {"layer": [{**LAYER, "cells": 10**400}]}}, "layer.gas.cells: found 1000000"),
        ({"geometry": {"layer": [{**LAYER, "cells": 3_000_000}]}}, "less than or equal to 100000"),
        ({"geometry": {"layer": [{**LAYER, "grading": 1e30}]}}, "0.01 to 100"),
        ({"geometry": {"layer": [LAYER, {**LAYER, "name": "b", "height": "1e25 m"}]}}, "rows above"),
        ({"chemistry": {"reaction": {"cvd": {"Ea": "-1e9 kJ/mol"}}}}, "rate constant of inf"),
        ({"chemistry": {"reaction": {"cvd": {"equation": f"{'9' * 400} TMA + H2O -> CH4"}}}}, "-> is the arrow"),
        ({"gas": {"pressure": "1e-30 Pa", "temperature": "1e30 K"}}, "gas.density: found keys that make it"),
        ({"gas": {"carrier": "N2\x1b[2J", "molar_mass": "28 g/mol", "viscosity": "2e-5 Pa s"}}, "printable"),
    ],
)  # fmt: skip
def test_what_the_fuzz_found(changes: dict[str, Any], line: str) -> None:
    geometry = {"length": "100 mm", "cell_width": "1 mm", "layer": [LAYER], **changes.get("geometry", {})}
    with pytest.raises(InputError) as caught:
        load_case({**changes, "geometry": geometry})
    assert line in str(caught.value) and str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a = " + "9" * 5000, "more than can be read"),
        ("a = " + "[" * 5000 + "]" * 5000, "more than can be read"),
        (".".join("a" * 3000) + " = 1", "nested more than 30 deep"),
    ],
)
def test_what_toml_alone_lets_through(text: str, line: str, tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=line):
        load_case(tmp_path / "case.toml")
