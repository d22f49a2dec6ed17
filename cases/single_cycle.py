"""A full cycle with the water dose delayed: mpirun -n 2 python cases/single_cycle.py [CASE.toml]"""

import sys

from mpm import Reactor, load_case

case = load_case(*sys.argv[1:] or ["single_cycle"]).with_({"geometry.inlet.water.start": "15 s"})
reactor = Reactor(case)


def watch(reactor: Reactor) -> None:
    """Called by every rank at every output time."""
    if reactor.comm.rank == 0:
        now = reactor.numbers
        print(
            f"{reactor.time:6.2f} s   CVD {now['cvd.rate_mean']:.2e} mol/m3/s   exit {now['titration.tma.exit_mean']:.3f}"
        )


result = reactor.run("results/single_cycle_delayed", callback=watch, overwrite=True)
methylated = result.coverage("bed", "OAl(CH3)2")  # rows from the bottom, columns; on every rank
if reactor.comm.rank == 0:
    print(
        "coverage at the end of zone 1, bottom to top:", methylated[:, reactor.grid.columns // 2 - 1].round(3)
    )
    print("TMA that reached the water zone:", result.summary["contamination"]["zone2"]["TMA"])
