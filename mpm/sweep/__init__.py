"""Parameter sweeps: many cases around one, on a laptop or a cluster (`mpm sweep`).

`plan` turns a sweep file into points named by their content, `driver` runs what has no verdict yet on a pool
(`cluster`), `point` and `guard` see a point's process to its end, `results`, `table` and `pictures` tell the outcome.
Nothing here imports MPI or the solver: a point is always a process of its own.
"""

from mpm.sweep.driver import run_sweep
from mpm.sweep.table import load_sweep

__all__ = ["load_sweep", "run_sweep"]
