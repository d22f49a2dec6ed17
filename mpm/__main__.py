"""`python -m mpm`, the form to use under mpirun."""

from mpm.cli import main

raise SystemExit(main())
