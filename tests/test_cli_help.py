"""The command line explains itself: whole sentences at any width, an example for every verb, one line where something is missing."""

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from mpm.cli import base, main
from mpm.dem.cli import app as dem_app
from mpm.help import example_of


def verbs() -> Iterator[tuple[str, Any]]:
    """Names as typed, with the commands behind them; those of `mpm dem`, too."""
    for prefix, app in (("mpm", base.app), ("mpm dem", dem_app)):
        group: Any = typer.main.get_command(app)
        yield prefix, group
        for name, command in group.commands.items():
            if name != "dem":
                yield f"{prefix} {name}", command


VERBS = dict(verbs())


def words(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("width", [80, 60])
def test_help_is_whole(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a sentence or a description is cut, a line is wider than the terminal (but for a command, which stays whole), or -h is
    not --help."""
    monkeypatch.setenv("COLUMNS", str(width))
    texts = {}
    for name, command in VERBS.items():
        assert main([*name.split()[1:], "-h"]) == 0
        text = texts[name] = capsys.readouterr().out
        assert main([*name.split()[1:], "--help"]) == 0
        assert capsys.readouterr().out == text
        long = [line for line in text.splitlines() if len(line) > width and not line.strip().startswith("mp")]
        assert long == [], name
        assert "..." not in words(text).replace("VERB ...", "").replace("DIR...", "").replace("-002, ...", "")
        for parameter in command.params:
            assert words(parameter.help or "").removesuffix(".") in words(text), name
    for name, command in VERBS.items():
        group, _, verb = name.rpartition(" ")
        if group and name != "mpm dem" and not command.hidden:
            first = words(command.help.partition("\n\n")[0]).removesuffix(".")
            assert f" {verb} {first}" in words(texts[group]), name


@pytest.mark.parametrize("name", [name for name in VERBS if name not in ("mpm", "mpm dem")])
def test_every_verb_has_examples_that_it_takes(name: str) -> None:
    """Fails when a verb's help shows no example, or one with an option or a number of arguments that the verb refuses."""
    command = VERBS[name]
    examples = [
        line.strip() for line in command.help.splitlines() if line.strip().startswith(("mpm ", "mpirun "))
    ]
    assert examples
    for example in examples:
        typed = shlex.split(example_of(example).partition(" > ")[0].replace("mpirun -n 4 python -m ", ""))
        arguments = typed[1:]
        for part in name.split()[1:]:
            if arguments and arguments[0] == part:
                arguments.pop(0)
        arguments = [a for a in arguments if a != "dem"]
        command.make_context(name, arguments)  # raises what a user would be told


@pytest.mark.parametrize("verb", ["run", "resume", "check", "mesh", "plot", "sweep", "optimise"])
def test_a_bare_verb_says_what_it_needs(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a verb without its argument does not show its help and say in one line what is missing, or ends with another status."""
    assert main([verb, "-h"]) == 0
    text, _ = capsys.readouterr()
    assert main([verb]) == 2
    out, err = capsys.readouterr()
    assert out == text and len(err.splitlines()) == 1
    assert " is missing: " in err and f"; for example: mpm {verb} " in err and " -h explains more)" in err


def test_bare_dem_is_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when `mpm dem`, a program of several verbs, does not list them as `mpm` does."""
    assert main(["dem", "-h"]) == 0
    text, _ = capsys.readouterr()
    assert "waveform" in text
    assert main(["dem"]) == 0
    assert capsys.readouterr() == (text, "")


def test_words_that_are_no_verb_or_option(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when a slip of the fingers does not get the nearest right word."""
    assert main(["chekc", "single_zone"]) == 2
    assert "Did you mean 'check'?" in capsys.readouterr().err
    assert main(["run", "single_zone", "--overwrit"]) == 2
    assert "--overwrite" in capsys.readouterr().err


def test_help_of_a_verb_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    """Fails when `mpm help run` is not `mpm run -h`, or an unknown verb is no error."""
    for arguments in (["run"], ["dem"], []):
        assert main(["help", *arguments]) == 0
        text = capsys.readouterr().out
        assert main([*arguments, "-h"]) == 0
        assert capsys.readouterr().out == text and text.startswith("Usage: mpm")
    assert main(["help", "nothing"]) == 2


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes_verbs_cases_and_keys(tmp_path: Path) -> None:
    """Fails when the script that `mpm --show-completion` prints does not complete verbs, options, cases, runs and keys in bash."""
    (tmp_path / "singular.toml").write_text("")
    (tmp_path / "results" / "first").mkdir(parents=True)
    (tmp_path / "results" / "first" / "case.toml").write_text("")
    script = """
eval "$(_MPM_COMPLETE=source_bash mpm)"
try() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _mpm_completion mpm; echo "${COMPREPLY[@]}"; }
try mpm res
try mpm run --overw
try mpm run sing
try mpm resume res
try mpm run single_zone --set geometry.inlet.tma.v
try mpm mechanism alumina_s
try mpm mechanism single_zone --set chemistry.reaction.tma.A
"""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", script], capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "PATH": path}
    )
    assert done.stdout.splitlines() == [
        "resume",
        "--overwrite",
        "single_cycle single_zone singular.toml",
        "results/first",
        "geometry.inlet.tma.velocity",
        "alumina_soft",
        "chemistry.reaction.tma.A",
    ], done.stderr
