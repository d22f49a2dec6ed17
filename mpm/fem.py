"""The one place that loads the finite-element stack.

The PyPI wheel `dolfinx-solver-real` must be imported as `dolfinx_solver` before dolfinx, petsc4py or slepc4py; conda-forge's
`fenics-dolfinx` has no such module. Every module that needs dolfinx or petsc4py imports this one first.
"""

from __future__ import annotations

import os
from contextlib import suppress

from mpm.errors import MpmError

# PETSc would take SIGTERM and SIGPIPE away from Python
os.environ["PETSC_OPTIONS"] = f"{os.environ.get('PETSC_OPTIONS', '')} -no_signal_handler".strip()

with suppress(ModuleNotFoundError):
    import dolfinx_solver  # noqa: F401

try:
    import dolfinx.fem.petsc
    from petsc4py import PETSc
except ModuleNotFoundError as missing:
    raise MpmError(
        f"the solver needs {missing.name}: install mpm[fem] from PyPI, or fenics-dolfinx from conda-forge"
    ) from missing

if PETSc.ScalarType is not PETSc.RealType:
    raise MpmError("this PETSc is built for complex numbers; mpm needs the real one (dolfinx-solver-real)")

__all__ = ["PETSc", "dolfinx"]
