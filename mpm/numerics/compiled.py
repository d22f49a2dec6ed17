"""C beside the Python that calls it, compiled when it is first used and kept with the compiled forms."""

from __future__ import annotations

import hashlib
import os
import sysconfig
import tempfile
from contextlib import suppress
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import cffi
import numpy as np

from mpm.arrays import Floats, Ints
from mpm.numerics.fem import cache_directory, cannot_compile
from mpm.parallel import any_rank, on_root

from mpi4py import MPI  # isort: skip  (after the finite-element stack)

FLAGS = ["-O3", "-fno-math-errno", "-ffp-contract=fast", "-fopenmp-simd", "-fvisibility=hidden"]
FAST = Path(__file__).with_name("fast.c")
"""What comes before all sources."""
_BUILDER = cffi.FFI()
_KINDS = {
    np.dtype(kind): _BUILDER.typeof(f"{name}[]")
    for kind, name in ((np.float64, "double"), (np.int64, "long"))
}
_loaded: dict[tuple[Path, tuple[tuple[str, int], ...]], Any] = {}


def compiled(comm: MPI.Comm, header: Path, *sources: Path, **constants: int) -> Any:
    """A module whose `lib` has the functions of the `header`, without lines for the preprocessor, and whose `ffi` makes its structs: from C
    `sources`, one after the other, with these `constants` for the preprocessor; collective.

    Rank 0 compiles, once for each set of constants, beside and then renames; all ranks share that file system, as they do for forms.
    Raises InputError where nothing can be compiled.
    """
    known = header, tuple(sorted(constants.items()))
    if known not in _loaded:
        _loaded[known] = _load(comm, header, sources, constants)
    return _loaded[known]


def _load(comm: MPI.Comm, header: Path, sources: tuple[Path, ...], constants: dict[str, int]) -> Any:
    declarations = header.read_text()
    defined = "".join(f"#define {name} {value}\n" for name, value in constants.items())
    text = defined + declarations + "".join(source.read_text() for source in (FAST, *sources))
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    made_of = repr((text, declarations, FLAGS, cffi.__version__, suffix))
    name = f"{header.stem}_{hashlib.sha256(made_of.encode()).hexdigest()[:16]}"
    library = cache_directory() / "compiled" / f"{name}{suffix}"

    def build() -> None:
        with suppress(ImportError):  # one that is broken is made again
            if library.exists():
                _module(name, library)
                return
        builder = cffi.FFI()
        builder.cdef(declarations)
        builder.set_source(name, text, extra_compile_args=FLAGS)
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as beside:
            os.replace(builder.compile(tmpdir=beside), library)

    def build_or_say() -> None:
        try:
            build()
        except (OSError, ImportError, cffi.VerificationError) as error:
            raise cannot_compile(error) from error

    on_root(comm, build_or_say)
    module, error = None, ImportError("another process cannot load it")
    try:
        module = _module(name, library)
    except ImportError as failed:
        error = failed
    if any_rank(comm, module is None):
        raise cannot_compile(error) from error
    return module


def _module(name: str, library: Path) -> Any:
    """A compiled library. Raises ImportError where it is none."""
    spec = spec_from_file_location(name, library)
    if spec is None or spec.loader is None:
        raise ImportError(f"{library} is no library")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pointer(values: Floats | Ints) -> Any:
    """What C takes for a contiguous array: doubles, or longs for int64. It keeps the array alive."""
    return _BUILDER.from_buffer(_KINDS[values.dtype], values)


class Struct:
    """One of the structs of a `module`, in `known`, with the arrays that are lent to it."""

    def __init__(self, module: Any, name: str):
        self.known = module.ffi.new(f"{name} *")
        self._lent: dict[str, Any] = {}

    def lend(self, **arrays: Floats | Ints) -> None:
        """Let C have these arrays, contiguous, by the names that it has for them."""
        for name, array in arrays.items():
            self._lent[name] = pointer(array)
            setattr(self.known, name, self._lent[name])
