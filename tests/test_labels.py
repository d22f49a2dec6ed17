"""Names of people's own making come back as they were from every file, and lead no writer astray."""

import csv
import io
import json
import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from mpm.case.case import Case, load_case
from mpm.errors import InputError
from mpm.files import file_name
from mpm.labels import literal, xml_attribute
from mpm.mesh.msh import read_msh, write_msh
from mpm.output.directory import RunDirectory
from mpm.output.vtu import encode_pvd, encode_vtu, grid_points, grid_quads, read_vtu
from mpm.pictures.outline import formula

NAMES = ['A"B', "A<B>&'C", "A/B", "OH[s]", "x,y;z", "$x$", "日本", "a\\b", "%20", "O2*"]


@pytest.mark.parametrize("name", NAMES)
def test_a_field_of_any_name_comes_back(name: str, tmp_path: Path) -> None:
    """Fails when a name breaks the XML of a .vtu, for our reader or for another."""
    content = encode_vtu(
        grid_points([0.0, 1.0], [0.0, 1.0]), grid_quads(1, 1), {f"x_{name}": np.array([3.0])}, 0.0
    )
    (tmp_path / "a.vtu").write_bytes(content)
    assert read_vtu(tmp_path / "a.vtu").cell_data[f"x_{name}"].tolist() == [3.0]
    head = content.partition(b'<AppendedData encoding="raw">')[0] + b"</VTKFile>"
    names = [entry.attrib["Name"] for entry in ElementTree.fromstring(head).iter("DataArray")]
    assert f"x_{name}" in names
    assert ElementTree.fromstring(f"<a b={xml_attribute(name)}/>").attrib["b"] == name
    listed = ElementTree.fromstring(encode_pvd([(0.0, name)])).find(".//DataSet")
    assert listed is not None and listed.attrib["file"] == name


def test_file_names_are_no_paths_and_stay_apart() -> None:
    """Fails when a picture of species A/B goes into a directory A, or over the picture of A_B."""
    assert (
        file_name("map_OAl(CH3)2") == "map_OAl(CH3)2"
        and file_name("titration.tma.exit_mean") == "titration.tma.exit_mean"
    )
    odd = [*NAMES, "A_B", "A%2FB", "../../x", "x" * 500, "x" * 499, "a\x00b", "."]
    made = [file_name(f"map_{name}") for name in odd]
    assert len(set(made)) == len(odd)
    assert not [name for name in made if "/" in name or "\x00" in name or len(name.encode()) > 200]


@pytest.mark.parametrize("title", [r"cost in $, $\frac{", "$", "a_b^{c", "$$", "50 % of $x$", "two\nlines"])
def test_a_title_is_no_formula(title: str) -> None:
    """Fails (matplotlib raises) when a dollar sign begins mathematics."""
    figure = Figure()
    figure.add_subplot().set_title(literal(title))
    figure.suptitle(formula(title))
    figure.savefig(io.BytesIO())


@pytest.mark.parametrize("name", ["a b", "a.b", "a\nb", "", "A->B", "A=>B", "\x1b[2J", "x\x00"])
def test_names_that_no_equation_could_use_are_refused(name: str) -> None:
    chemistry = {"mechanism": "inline", "species": {name: {"molar_mass": "16 g/mol", "formula": "CH4"}}}
    with pytest.raises(InputError, match="a name without blanks, dots and arrows"):
        load_case({"geometry": STRIP, "chemistry": chemistry})


STRIP = {"length": "9 mm", "cell_width": "3 mm", "layer": [{"name": "gas", "height": "1 mm", "cells": 2}]}


def odd_case() -> Case:
    """Every name that a case may choose, at its oddest."""
    return load_case(
        {
            "title": 'He said "µ < 3 & $x$, [/b]"\nand left',
            "geometry": {
                **STRIP,
                "layer": [{"name": "Schicht_é-1", "height": "1 mm", "cells": 2, "material": 'glas, "fein" [/a]'}],
                "inlet": [{"name": "größer", "center": "3 mm", "width": "3 mm", "mass_fractions": {"A/B": 1e-3}}],
                "outlet": [{"name": "aus", "center": "6 mm", "width": "3 mm", "side": "top"}],
            },
            "material": {'glas, "fein" [/a]': {"porosity": 0.4, "permeability": "4 um^2", "surface_to_volume": "1e4 1/m"}},
            "gas": {"carrier": 'N2, "rein"', "molar_mass": "28 g/mol", "viscosity": "2e-5 Pa s"},
            "chemistry": {
                "mechanism": "inline",
                "species": {"A/B": {"formula": "CH4", "molar_mass": "16 g/mol"}},
                "site": {'OH["s"]': {"formula": "OH"}, "X,Y$": {"formula": "CH4OH"}},
                "reaction": {"r.1 [x]": {"equation": 'OH["s"] + A/B -> X,Y$', "sticking": 0.1}},
            },
        }
    )  # fmt: skip


def test_a_case_of_odd_names_comes_back_from_its_files(tmp_path: Path) -> None:
    """Fails when a comma, a quote, a line end or an umlaut in a name breaks case.toml, the mesh or a table."""
    case = odd_case()
    assert load_case(tomllib.loads(case.to_toml())) == case
    assert load_case(json.loads(json.dumps(case.to_dict()))) == case
    path = tmp_path / "mesh.msh"
    written = write_msh(case, path)
    assert list(read_msh(case, path).ports) == list(written.ports) == ["größer", "aus"]
    directory = RunDirectory(tmp_path / "run")
    directory.prepare()
    names = [f"outlets.aus.x.{name}" for name in (*case.mechanism.species_names, case.gas.carrier, "a\nb")]
    directory.append_history({"time": 0.0, **dict.fromkeys(names, 0.25)})
    with (tmp_path / "run" / "history.csv").open(newline="", encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert row == {"time": "0.0", **dict.fromkeys(names, "0.25")}
    assert RunDirectory(tmp_path / "run").history()[names[1]].tolist() == [0.25]
