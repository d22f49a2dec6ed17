"""How fast a bed moves under its own forces, over acceleration, angle, friction and through-flow: docs/bed_motion.md and its figure.

    python scripts/bed_motion.py            # some seconds

Beds are those of the built-in case single_zone with motion.profile = "force_balance". What the source (the thesis that the model follows)
measured or simulated stands beside them with its chapter.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mpm import load_case
from mpm.advice.motion import flight_force
from mpm.case.case import Case
from mpm.errors import InputError
from mpm.files import write_atomically
from mpm.physics.bed_cycle import BedCycle

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "bed_motion.md"
PICTURE = ROOT / "docs" / "figures" / "bed_motion.png"
GAMMAS = (0.25, 0.30, 0.35, 0.40, 0.45, 0.50, 0.55, 0.60)
ANGLES = (60, 45, 30)
FRICTIONS = (0.2, 0.4, 0.6)
SHARE = 0.9
"""Of the velocity at which gas carries the bed, the largest through-flow of the tables."""
GL223 = {"material.glass_beads.permeability": f"{4.25 * (223 / 56) ** 2!r} um^2"}
"""Beads of 223 um in place of 56 um: permeability as the square of the diameter (Kozeny and Carman)."""
GL223_AERATED = GL223 | {"motion.through_velocity": "1 cm/s"}


def bed(gamma: float, changes: dict[str, Any] | None = None, **motion: Any) -> Case:
    """The base zone with the bed under its own forces; keys of [motion] by name."""
    keys = {f"motion.{key}": value for key, value in motion.items()}
    return load_case(
        "single_zone",
        {"motion.profile": "force_balance", "motion.gamma": gamma, **keys, **(changes or {})},
    )


def cycle(case: Case) -> BedCycle:
    """How its bed moves."""
    found = case.motion.balance
    assert found is not None
    return found


def speed(gamma: float, changes: dict[str, Any] | None = None, **motion: Any) -> str:
    """Its mean speed [cm/s]; a dash where gas carries the bed away."""
    try:
        return f"{100.0 * bed(gamma, changes, **motion).motion.mean_velocity:.2f}"
    except InputError:
        return "-"


def flows() -> dict[str, str]:
    """Through-flows by their words: none, that of the ports, and one just below fluidisation."""
    forces = cycle(bed(0.30)).forces
    most = SHARE * forces.weight / forces.resistance
    return {
        "none": "0 m/s",
        f"of the ports, {forces.through_flow * 100:.2f} cm/s": f"{forces.through_flow!r} m/s",
        f"{SHARE:g} u_mf, {most * 100:.2f} cm/s": f"{most!r} m/s",
    }


def speeds(column: str) -> str:
    """Speeds over all that is varied, with the gas column at rest in the reactor's or the lab's frame."""
    lines = [
        f"| through-flow | angle | friction | {' | '.join(f'{g:.2f}' for g in GAMMAS)} |",
        f"|---|---|---{'|---' * len(GAMMAS)}|",
    ]
    for words, flow in flows().items():
        for angle in ANGLES:
            for friction in FRICTIONS:
                found = [
                    speed(
                        g, through_velocity=flow, angle=f"{angle} deg", friction=friction, gas_column=column
                    )
                    for g in GAMMAS
                ]
                lines.append(f"| {words} | {angle} deg | {friction} | {' | '.join(found)} |")
    return "\n".join(lines)


MEASURED: tuple[tuple[str, float, str, dict[str, Any]], ...] = (
    ("GL56, 56 um, experiment at Gamma 0.30 (5.3.4)", 0.30, "1.3", {}),
    ("glass beads and steel, experiments at Gamma 0.25 (3.4.3)", 0.25, "from 1.0", {}),
    ("the same at Gamma 0.60 (3.4.3)", 0.60, "to 3.5", {}),
    ("GL223, 223 um, CFD-DEM at Gamma 0.30 (4.4.2)", 0.30, "0.58", GL223_AERATED),
    ("GL223, CFD-DEM at Gamma 0.50: 22.5 mm in 1.11 s (4.4.2)", 0.50, "2.03", GL223_AERATED),
)
"""What the source gives [cm/s], and with what it is compared. The gas of its simulations of GL223 is not printed; 1 cm/s is that of
its experiments with it (4.4.1)."""


def beside() -> str:
    """Speeds of the source beside those of the balance with three frictions and angles."""
    heads = [f"{angle} deg, {friction}" for angle in ANGLES for friction in (0.3, 0.4, 0.5)]
    lines = [f"| source | its speed | {' | '.join(heads)} |", f"|---|---{'|---' * len(heads)}|"]
    for words, gamma, value, changes in MEASURED:
        found = [
            speed(gamma, dict(changes), angle=f"{angle} deg", friction=friction)
            for angle in ANGLES
            for friction in (0.3, 0.4, 0.5)
        ]
        lines.append(f"| {words} | {value} | {' | '.join(found)} |")
    return "\n".join(lines)


def phases() -> str:
    """What the base bed does in a cycle."""
    lines = [
        "| Gamma | gas column | slides | flies | lift-off, landing [deg] | largest gap | contact force [Pa] | speed [cm/s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for column in ("reactor", "lab"):
        for gamma in (0.30, 0.45, 0.60):
            found = cycle(bed(gamma, gas_column=column))
            flight = (
                ", ".join(f"{math.degrees(p):.2f}" for p in found.flights[0]) if found.flights else "never"
            )
            gap, (least, most) = found.largest_gap, found.contact_range
            lines.append(
                f"| {gamma:.2f} | {column} | {100 * found.share('slide'):.1f} | {100 * found.share('flight'):.1f} | {flight} | "
                f"{f'{gap * 1e6:.2f} um' if gap < 1e-4 else f'{gap * 1e3:.2f} mm'} | {least:.1f} to {most:.1f} | {100 * found.mean:.2f} |"
            )
    return "\n".join(lines)


def page() -> str:
    """The whole document."""
    base, prescribed = cycle(bed(0.30)), flight_force(load_case("single_zone"))
    assert prescribed is not None
    forces, held = base.forces, cycle(bed(0.60, adhesion="72 Pa"))
    return f"""# The bed under its own forces

`motion.profile = "force_balance"` asks what weight, gas, friction and adhesion make of the bed, in place of a prescribed speed and
flight. Measured by `python scripts/bed_motion.py`; equations are in `mpm/physics/bed_balance.py`.

**In short**: in the reactor, whose floor is closed but for the ports, the bed of the base case does not leave what it lies on at Gamma
0.30. It weighs {forces.weight:.1f} Pa per area, of which the gas of the ports carries {100 * forces.gas_share:.0f} %, and it is
conveyed by sliding under what is left: {100 * base.mean:.2f} cm/s at 60 deg from the horizontal,
{speed(0.30, angle="45 deg")} at 45 deg and {speed(0.30, angle="30 deg")} at 30 deg (friction 0.4).
The source measured 1.3 cm/s. The flight that the preset "thesis" prescribes would
take {prescribed[0]:.0f} to {prescribed[1]:+.0f} Pa of gas force; `mpm check` says so.

## What the base bed does

Friction 0.4, 60 deg, 16 Hz, {forces.through_flow * 100:.2f} cm/s of gas, R = mu h/K = {forces.resistance:,.0f} Pa s/m.
Shares are those of the cycle, in per cent.

{phases()}

![contact force, gap and velocities over a cycle](figures/bed_motion.png)

A gas column that rests in the lab (`gas_column = "lab"`, an open floor) holds the bed where it is: it is off the base for most of the cycle
and hardly conveyed. In a closed reactor gas cannot follow into the gap so fast: what rises is {forces.through_flow * 100:.2f} cm/s
against the reactor's {100 * forces.ay * forces.omega:.2f} cm/s. The gap is not in the mesh: the bed stays locked to the reactor
vertically. Of micrometres it is less than a particle; opened as the preset "thesis" prescribes it has changed the mean coverage of the
box at 24 s by +0.010 (Gamma 0.30) and -0.009 (0.60).

## Beside the source

Numbers in brackets are sections of the source. Speeds in cm/s, angles from the horizontal, coefficients of friction 0.3 to 0.5. Gas as
the ports feed it; for the large beads, whose permeability is {4.25 * (223 / 56) ** 2:.0f} um^2 by Kozeny and Carman, the 1 cm/s of the
experiments with them (4.4.1), since that of the simulations is not printed.

{beside()}

At the 60 deg of the source the balance gives half of the measured speed of GL56 or less, with any friction that the source has measured;
counted from the vertical, which is 30 deg, it gives more. In between, at 45 deg with friction 0.3 to 0.4, it gives the speed, which is one
number met by eye and proves nothing. At 60 deg it takes gas near fluidisation (below).

The source's wall friction is 0.29 to 0.52 (figure 3.8; 0.29 to 0.38 for GL223). The adhesion that it extrapolates from yield loci, 72 Pa
for GL56 (figure 3.9), would be {72.0 / forces.weight:.1f} times the weight of 3 mm of bed: with `adhesion = "72 Pa"` the bed moves at
{100 * held.mean:.2f} cm/s at Gamma 0.60, so it does not act on a bed that is conveyed. Its slowest speed, 0.33 cm/s (2.4), is a simulation
at 0.7 g.

## Speeds, gas column with the reactor

In cm/s over Gamma. Without gas the bed is a block on a conveyor.

{speeds("reactor")}

## Speeds, gas column at rest in the lab

{speeds("lab")}
"""


def figure() -> Figure:
    """Contact force, gap and horizontal velocities of the base bed over a cycle."""
    drawn = Figure(figsize=(10, 7), layout="constrained")
    panels = drawn.subplots(3, 3, sharex=True, sharey="row")
    for column, gamma in enumerate((0.30, 0.45, 0.60)):
        found = cycle(bed(gamma))
        phase = np.linspace(0.0, 2.0 * np.pi, 1441)
        degrees = np.degrees(phase)
        force, gap, velocity = panels[:, column]
        force.plot(degrees, [found.contact_force(p) for p in phase], color="#1f4e79")
        force.axhline(found.forces.weight, color="grey", linestyle=":")
        force.text(355, found.forces.weight, "weight", color="grey", ha="right", va="bottom")
        force.set_ylim(-2.0, 45.0)
        force.set_title(f"Gamma {gamma:.2f}: {100 * found.mean:.2f} cm/s")
        gap.plot(degrees, [1e6 * found.gap(p) for p in phase], color="#1f4e79")
        velocity.plot(
            degrees, [100 * found.forces.base_speed(p) for p in phase], color="grey", label="reactor"
        )
        velocity.plot(degrees, [100 * found.velocity(p) for p in phase], color="#c55a11", label="bed")
        velocity.set_xlabel("phase [deg]")
        velocity.set_xticks(range(0, 361, 90))
        for panel in panels[:, column]:
            for segment in found.segments:
                if segment.kind == "flight":
                    panel.axvspan(
                        math.degrees(segment.start), math.degrees(segment.stop), color="#fbe5d6", zorder=0
                    )
    panels[0, 0].set_ylabel("contact force [Pa]")
    panels[1, 0].set_ylabel("gap [um]")
    panels[2, 0].set_ylabel("horizontal velocity [cm/s]")
    panels[2, 0].legend(frameon=False)
    return drawn


def main() -> None:
    """Write the page and its figure."""
    figure().savefig(PICTURE, dpi=110)
    write_atomically(PAGE, page())


if __name__ == "__main__":
    main()
