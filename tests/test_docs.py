"""What the documentation tells people to type works as printed."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.advice.checks import check_case
from mpm.case.case import load_case
from mpm.case.settings import parse_settings
from mpm.cli import main
from mpm.mesh.grid import Grid
from mpm.output.directory import RunDirectory

from .cases import TINY

ROOT = Path(__file__).parent.parent


def blocks(document: str, language: str) -> list[str]:
    text = (ROOT / document).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def test_first_case_of_the_readme_is_valid(tmp_path: Path) -> None:
    """Fails when the case that a newcomer copies is refused, or does not do what its title says."""
    (text,) = blocks("README.md", "toml")
    (tmp_path / "wide_port.toml").write_text(text, encoding="utf-8")
    case = load_case(tmp_path / "wide_port.toml", {"motion.bed_velocity": "0.8 cm/s"})
    tma = next(inlet for inlet in case.geometry.inlets if inlet.name == "tma")
    assert tma.width == pytest.approx(8e-3) and tma.mass_fractions == {"TMA": 1e-4}
    assert case.geometry.length == pytest.approx(0.1397) and case.motion.bed_velocity == pytest.approx(0.008)


def steps_of_the_readme() -> list[tuple[str, str]]:
    """What a newcomer does, in the order of the text: (kind, content) of case files to save, commands to type and programs to run."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = re.finditer(
        r"^```(toml|python)\n(.*?)^```|^    ((?:make|mpm|mpirun) [^\n]*)$", text, re.DOTALL | re.MULTILINE
    )
    return [("command", match[3]) if match[3] else (match[1], match[2]) for match in found]


@pytest.mark.slow
def test_steps_of_the_readme_work_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], mpirun: Any
) -> None:
    """Fails when a command or program of the README, typed in the order of the text in an empty directory, does not end well.

    Meshes are coarse and times short; `make demo` is what it runs.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    layers = ", ".join(
        f'{{ name = "{key.split(".")[2]}", cells = {number} }}'
        for key, number in TINY.items()
        if "layer" in key
    )
    coarse = f'cell_width = "{TINY["geometry.cell_width"]}"\nlayer = [{layers}]\n'
    done = []
    for kind, content in steps_of_the_readme():
        if kind == "toml":
            case = content.replace("[geometry]\n", f"[geometry]\n{coarse}").replace(
                'end = "20 s"', 'end = "1 s"'
            )
            assert case.count("\n") == content.count("\n") + 2 and 'end = "1 s"' in case
            Path("wide_port.toml").write_text(case, encoding="utf-8")
        elif kind == "python":
            subprocess.run([sys.executable, "-c", content], check=True, timeout=120)
        else:
            words = [
                word for word in shlex.split(content, comments=True) if word != "--open"
            ]  # no ParaView here
            if words[0] == "make":
                options = [part for key, value in TINY.items() for part in ("--set", f"{key}={value}")]
                words = ["mpm", "run", "single_zone", "-q", "--set", "time.end=1 s", *options]
                if content.split()[1] != "demo":
                    continue
            if words[0] == "mpm":
                assert main(words[1:]) == 0, f"{content}: {capfd.readouterr().err}"
            else:
                subprocess.run(
                    [str(Path(sys.executable).with_name(words[0])), *words[1:]], check=True, timeout=120
                )
            done.append(words[1] if words[0] == "mpm" else words[0])
    assert {"check", "run", "watch", "plot", "resume", "compare", "mpirun"} <= set(done)
    results = {path.name for path in Path("results").iterdir()}
    assert {"wide_port", "slow", "wide_port-001"} <= results
    summary = json.loads(Path("results/wide_port/summary.json").read_text())
    assert summary["simulated_seconds"] == 25.0


def test_readers_of_the_documentation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a printed way to read the results of `make demo` does not give the numbers that were written."""
    pytest.importorskip("pyvista")
    case = load_case("single_zone", {"geometry.cell_width": "4 mm"})
    grid = Grid.from_case(case)
    directory = RunDirectory(tmp_path / "results" / "single_zone")
    directory.prepare()
    directory.write_case(case.to_toml())
    number = np.arange(grid.cells, dtype=float)
    for step in range(81):
        directory.write_fields(step / 4, grid, {"theta_OAl(CH3)2": number + step, "C_TMA": number * step})
        directory.append_history({"time": step / 4, "balance.TMA": 1e-13 * step})
    monkeypatch.chdir(tmp_path)
    bed = (number + 80)[np.isin(np.arange(grid.cells) // grid.columns, range(21, 31))]
    with_pyvista: dict[str, Any] = {}
    with_mpm: dict[str, Any] = {}
    with_numpy: dict[str, Any] = {}
    for code, names in zip(
        blocks("docs/output.md", "python"), (with_pyvista, with_mpm, with_numpy), strict=True
    ):
        exec(code, names)
    assert with_pyvista["reader"].active_time_value == 20.0
    assert np.array_equal(with_pyvista["bed"]["theta_OAl(CH3)2"], bed)
    assert np.array_equal(with_mpm["bed"].ravel(), bed)
    assert np.array_equal(with_numpy["concentration"], (number * 80).astype(np.float32))


def test_settings_of_the_list_of_differences() -> None:
    """Fails when a setting of docs/source.md that gives the thesis' reading is refused, or changes nothing."""
    text = (ROOT / "docs" / "source.md").read_text(encoding="utf-8")
    settings = [s for s in re.findall(r"`([^`\n]+=[^`\n]+)`", text) if re.match(r"[a-z]+\.", s)]
    assert len(settings) >= 14
    for setting in settings:
        changes = parse_settings([setting])
        base = load_case(
            "single_zone", {"geometry.layer.frit.material": "frit_mesh"} if "frit_mesh" in setting else {}
        )
        assert base.with_(changes) != base, setting


def test_figures_of_the_list_of_differences() -> None:
    """Fails when an excess number or a mesh of docs/source.md is no longer what `mpm check` prints."""
    changed: dict[float, dict[str, Any]] = {
        1.79: {},
        8.96: {"geometry.inlet.tma.mass_fractions.TMA": 1e-3},
        1.48: {"gas.pressure": "626 torr"},
    }
    for excess, changes in changed.items():
        report = check_case(load_case("single_zone", changes))
        assert report["inlets"]["tma"]["excess_number"] == pytest.approx(excess, abs=5e-3)
    rows = {"plenum": 26, "frit": 10, "bed": 18, "headspace": 67}
    fine = load_case("single_zone", {f"geometry.layer.{name}.cells": n for name, n in rows.items()})
    assert Grid.from_case(fine).cells == 49731 and Grid.from_case(load_case("single_zone")).cells == 28359
    bare = {"material.glass_beads.tortuosity_factor": 0.46}
    assert check_case(load_case("single_zone", bare))["inlets"]["tma"]["Pe_bed"] == pytest.approx(
        0.21, abs=5e-3
    )


@pytest.mark.parametrize(
    "document", sorted(str(p.relative_to(ROOT)) for p in [ROOT / "README.md", *ROOT.glob("docs/*.md")])
)
def test_links_lead_somewhere(document: str) -> None:
    """Fails when a document points to a file that does not exist."""
    text = (ROOT / document).read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text) if "://" not in link]
    assert [link for link in links if not (ROOT / document).parent.joinpath(link).exists()] == []


def test_reference_of_the_case_file_is_that_of_the_program() -> None:
    """Fails when a key or its description has changed since `python scripts/case_file.py` has written docs/case_file.md."""
    sys.path.insert(0, str(ROOT / "scripts"))
    import case_file

    assert (ROOT / "docs" / "case_file.md").read_text(encoding="utf-8") == case_file.reference()
