"""Moving porous media: an open model of vibrating powder reactors for atomic layer deposition, on FEniCSx.

    from mpm import Reactor, load_case

    result = Reactor(load_case("single_zone")).run()

Names are imported on first use, so that `import mpm` needs neither dolfinx nor MPI.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpm.case.case import Case as Case
    from mpm.case.case import load_case as load_case
    from mpm.errors import ConvergenceError as ConvergenceError
    from mpm.errors import InputError as InputError
    from mpm.errors import Interrupted as Interrupted
    from mpm.errors import MpmError as MpmError
    from mpm.mesh.grid import Grid as Grid
    from mpm.reactor.reactor import Reactor as Reactor
    from mpm.session import check as check
    from mpm.session import load_run as load_run
    from mpm.session import plot as plot
    from mpm.sweep import load_sweep as load_sweep

_HOME = {
    "Case": "mpm.case.case",
    "load_case": "mpm.case.case",
    "ConvergenceError": "mpm.errors",
    "InputError": "mpm.errors",
    "Interrupted": "mpm.errors",
    "MpmError": "mpm.errors",
    "Grid": "mpm.mesh.grid",
    "Reactor": "mpm.reactor.reactor",
    "check": "mpm.session",
    "plot": "mpm.session",
    "load_run": "mpm.session",
    "load_sweep": "mpm.sweep",
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("mpm")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *_HOME]
