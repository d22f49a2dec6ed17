"""The command line: `mpm` or `python -m mpm`, serially or under mpirun. A module for each kind of verb.

What a verb needs is imported when it is called: `mpm --help` loads neither numpy nor MPI.
"""

from mpm.cli import case, dem, find, look, many, mechanism, run  # noqa: F401  (each registers its verbs)
from mpm.cli.program import main as main
