"""The one place that loads the finite-element stack.

The PyPI wheel `dolfinx-solver-real` must be imported as `dolfinx_solver` before dolfinx, petsc4py or slepc4py; conda-forge's
`fenics-dolfinx` has no such module. Every module that needs dolfinx or petsc4py imports this one first.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from textwrap import shorten
from typing import Any

from mpm.errors import FULL, InputError, MpmError
from mpm.files import lock
from mpm.launcher import share_cores

share_cores(os.environ)

# PETSc would take SIGTERM and SIGPIPE away from Python
os.environ["PETSC_OPTIONS"] = f"{os.environ.get('PETSC_OPTIONS', '')} -no_signal_handler".strip()

with suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401

try:
    import cffi
    import dolfinx.fem.petsc
    import ffcx.codegeneration.jit
    from petsc4py import PETSc
except ModuleNotFoundError as missing:
    raise MpmError(
        f"the solver needs {missing.name}: install mpm[fem] from PyPI, or fenics-dolfinx from conda-forge"
    ) from missing

if PETSc.ScalarType is not PETSc.RealType:
    raise MpmError("this PETSc is built for complex numbers; mpm needs the real one (dolfinx-solver-real)")

__all__ = ["PETSc", "check_cache", "dolfinx"]
COMPILING = 300.0  # seconds to wait for another process that compiles


def cache_directory() -> Path:
    """Where compiled forms are kept: mpm's own part of dolfinx's cache. Raises InputError when there is no home to look in."""
    try:
        return Path(dolfinx.jit.get_options()["cache_dir"]) / "mpm"
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"the home directory cannot be read ({error}); set HOME, or XDG_CACHE_HOME and XDG_CONFIG_HOME"
        ) from error


def check_cache() -> None:
    """Raise InputError when compiled forms can be neither kept nor found; call it before the first form, where ranks can still agree."""
    path = cache_directory()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        if error.errno in FULL:
            raise
        raise InputError(
            f"{path}: cannot keep compiled equations here ({error.strerror}); set XDG_CACHE_HOME to a directory with write access"
        ) from error
    if not os.access(path, os.W_OK) and not any(path.glob("*.c.cached")):
        raise InputError(
            f"{path}: cannot keep compiled equations here (no write access); set XDG_CACHE_HOME to a directory with write access"
        )


class NotReady(Exception):
    """A form has not been compiled yet."""


def one_at_a_time(compile_forms: Callable[..., Any], look_up: Callable[..., Any]) -> Callable[..., Any]:
    """ffcx's compiler, one process at a time in mpm's cache; forms that are ready are loaded without waiting for it. `look_up` is what ffcx
    itself looks a form up with.

    ffcx marks a form as taken by its .c file and as ready by its .c.cached; whoever finds the first alone waits for the second. A process
    that was killed in between would make all later ones wait in vain. Under the lock nobody is in between: such files are left over, and
    removed.
    """

    def only_if_ready(name: str, objects: Any, cache_dir: Path, timeout: int) -> Any:
        source = Path(cache_dir) / f"{name}.c"
        if not (source.exists() and source.with_suffix(".c.cached").exists()):
            raise NotReady
        return look_up(name, objects, cache_dir, timeout)

    @functools.wraps(compile_forms)
    def compile_here(forms: Any, options: Any = None, cache_dir: Any = None, **rest: Any) -> Any:
        cache = cache_directory()
        with suppress(NotReady), replaced(ffcx.codegeneration.jit, "get_cached_module", only_if_ready):
            return compile_forms(forms, options=options, cache_dir=cache, **rest)
        try:
            alone = lock(cache / "lock", COMPILING) if os.access(cache, os.W_OK) else nullcontext()
        except BlockingIOError:
            raise TimeoutError(f"another process has been compiling for {COMPILING:g} s") from None
        with alone:
            for source in cache.glob("*.c"):
                if not source.with_suffix(".c.cached").exists():
                    source.unlink(missing_ok=True)
            return compile_forms(forms, options=options, cache_dir=cache, **rest)

    return compile_here


@contextmanager
def replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    """`owner.name` is `value` for a while."""
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


def reported(jit: Callable[..., Any]) -> Callable[..., Any]:
    """dolfinx's compiler with one line for what keeps forms from being compiled, the same on every rank."""

    @functools.wraps(jit)
    def compile_reported(*arguments: Any, **options: Any) -> Any:
        try:
            return jit(*arguments, **options)
        except (RuntimeError, TimeoutError, cffi.VerificationError) as error:
            raise cannot_compile(error) from error

    return compile_reported


def cannot_compile(error: Exception) -> InputError:
    """What to raise for an `error` of the compiler."""
    said = shorten(str(error), 120)
    return InputError(
        f"{cache_directory()}: the equations cannot be compiled ({said}); a C compiler and room for the files are needed"
    )


dolfinx.jit.ffcx_jit = reported(dolfinx.jit.ffcx_jit)
ffcx.codegeneration.jit.compile_forms = one_at_a_time(
    ffcx.codegeneration.jit.compile_forms, ffcx.codegeneration.jit.get_cached_module
)
