"""A TMA zone at twice the gas velocity: mpirun -n 2 python cases/single_zone.py [CASE.toml]"""

import sys

from mpm import Reactor, load_case

case = load_case(*sys.argv[1:] or ["single_zone"]).with_({"geometry.inlet.tma.velocity": "7 cm/s"})
reactor = Reactor(case)


def watch(reactor: Reactor) -> None:
    """Called by every rank at every output time; `field` is collective, so all of them call it."""
    tma = reactor.field("C_TMA")
    if reactor.comm.rank == 0:
        print(
            f"{reactor.time:6.2f} s   largest C_TMA in the headspace {tma[reactor.grid.layer_rows('headspace')].max():.2e} mol/m3"
        )


result = reactor.run("results/single_zone_fast", callback=watch, overwrite=True)
if reactor.comm.rank == 0:
    print(
        "coverage at the exit:",
        result.summary["titration"]["tma"]["exit_mean"],
        "of",
        result.summary["excess_number"]["tma"],
    )
    print("outlet CH4 over time:", result.history["outlets.zone1.x.CH4"][1:])
