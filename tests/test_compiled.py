"""C that is compiled at its first use."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mpm.errors import InputError
from mpm.numerics import compiled

from mpi4py import MPI  # isort: skip  (after fem)


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A source file, and a cache of its own."""
    monkeypatch.setattr(compiled, "cache_directory", lambda: tmp_path / "cache")
    monkeypatch.setattr(compiled, "_loaded", {})
    (tmp_path / "twice.h").write_text("double twice(double x); /* FACTOR x */\n")
    path = tmp_path / "twice.c"
    path.write_text("double twice(double x) { return FACTOR * x; }\n")
    return path


def twice(source: Path, factor: int) -> Any:
    """The function, compiled for this factor."""
    return compiled.compiled(MPI.COMM_SELF, source.with_suffix(".h"), source, FACTOR=factor).lib.twice


def test_a_library_is_kept_and_a_broken_one_made_anew(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when constants do not reach the source, a library is compiled twice, or one that a full disk cut off ends every later run."""
    assert twice(source, 2)(21.0) == 42.0
    assert twice(source, 3)(21.0) == 63.0
    libraries = {path: path.stat().st_mtime_ns for path in (source.parent / "cache" / "compiled").iterdir()}
    assert len(libraries) == 2
    monkeypatch.setattr(compiled, "_loaded", {})
    assert twice(source, 2)(21.0) == 42.0
    assert {path: path.stat().st_mtime_ns for path in libraries} == libraries
    elsewhere = source.parent / "elsewhere"
    (elsewhere / "compiled").mkdir(parents=True)
    for path in libraries:
        (elsewhere / "compiled" / path.name).touch()  # broken
    monkeypatch.setattr(compiled, "_loaded", {})
    monkeypatch.setattr(compiled, "cache_directory", lambda: elsewhere)
    assert twice(source, 2)(21.0) == 42.0


def test_nothing_compiles_without_a_compiler(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when the lack of a compiler is not told as what it is."""
    monkeypatch.setenv("CC", "/nonexistent/cc")
    with pytest.raises(InputError, match="a C compiler and room for the files are needed"):
        twice(source, 2)


def test_pointers_are_of_contiguous_arrays() -> None:
    """Fails when C gets an array whose values lie apart."""
    with pytest.raises(ValueError, match="contiguous"):
        compiled.pointer(np.zeros((4, 4))[:, 1])
