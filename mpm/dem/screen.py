"""What a powder run says on the screen: how far each seed is, and what has come out."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpm.screen import Sheet, number, say, screen, together

from .case import DemCase

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

Report = Callable[[int, float, str], None]
"""(seed, cycles done, what the seed is doing)."""
SLIP = 0.01
"""Mean free path over diameter above which gas slips at the surface of a particle, and drag falls (Loth, 2.a.3: by 2 %)."""
BETWEEN = 10.0
"""Seconds between two lines where there is no terminal."""


def silent(seed: int, cycles: float, doing: str) -> None:
    """No progress report."""


class SeedsProgress:
    """`with SeedsProgress(case) as report`: a bar for each seed that renews itself, or in a pipe a line every ten seconds."""

    def __init__(self, case: DemCase):
        self.case = case
        self.console = screen(stderr=True)
        self.bar: Progress | None = None
        self.tasks: dict[int, TaskID] = {}
        self.printed = time.monotonic()

    def __enter__(self) -> Report:
        if not self.console.is_terminal:
            return self._line
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(20),
            TextColumn("{task.fields[doing]}"),
            TimeElapsedColumn(),
            console=self.console,
        )
        self.tasks = {
            seed: self.bar.add_task(f"seed {seed}", total=self.case.run.cycles, doing="starting", start=False)
            for seed in self.case.run.seeds
        }
        self.bar.start()
        return self._update

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()

    def _update(self, seed: int, cycles: float, doing: str) -> None:
        assert self.bar is not None
        self.bar.start_task(self.tasks[seed])
        self.bar.update(self.tasks[seed], completed=cycles, doing=doing)

    def _line(self, seed: int, cycles: float, doing: str) -> None:
        if time.monotonic() - self.printed > BETWEEN or cycles >= self.case.run.cycles:
            self.printed = time.monotonic()
            say(self.console, f"seed {seed}: {doing}")


def cycles_done(done: float, cycles: int) -> str:
    """How far the shaking is."""
    return f"{done:.1f} of {cycles} cycles"


def settling(speed: float, rest: float) -> str:
    """How far the filling is from rest: its root mean square `speed`, and the one below which it counts as `rest` [m/s]."""
    return f"settling, still at {1e3 * speed:.2g} mm/s (rest: {1e3 * rest:.2g} mm/s)"


def print_result(summary: dict[str, Any], directory: Path, console: "Console") -> None:
    """The numbers one looks at first, what a reader must know about their limits, and what to do with them."""
    speed, lift, limits, bed = (summary[key] for key in ("mean_velocity", "liftoff", "limits", "bed"))
    spread = f" ± {100 * speed['spread']:.2f}" if speed.get("spread") is not None else ""
    sheet = Sheet(room=30)
    sheet.group("Bed velocity along the base, in the frame of the laboratory")
    sheet.add(
        "mean of a cycle" + (" ± spread of the seeds" if spread else ""),
        together(f"{100 * speed['mean']:.2f}{spread} cm/s"),
    )
    sheet.add("of each seed", ", ".join(together(f"{100 * v:.2f} cm/s") for v in speed["seeds"]))
    sheet.add("limit of a straight drop", number(100 * limits["straight_drop"], "cm/s"))
    sheet.add("limit of perfect flight", number(100 * limits["perfect_flight"], "cm/s"))
    sheet.add("efficiency: mean over perfect flight", f"{summary['efficiency']:.2f}")
    sheet.group("Bed")
    flight = "none"
    if lift.get("phase_deg") is not None:
        flight = together(f"{lift['phase_deg']:.0f} to {lift['contact_phase_deg']:.0f} deg")
    sheet.add("phases of the vibration in flight", flight)
    sheet.add("contacts of a particle, mean count", f"{summary['coordination']['contacts_per_particle']:.1f}")
    sheet.add("gamma: peak acceleration over gravity", f"{limits['gamma']:.3g}")
    sheet.add("throw number: both across the base", f"{limits['throw_number']:.3g}")
    sheet.group("Granular Bond numbers: pull-off force over weight")
    for name, words in (("pair", "of two particles"), ("base", "of a particle on the base")):
        real, simulated = bed[f"bond_number_{name}"], bed[f"simulated_bond_number_{name}"]
        sheet.add(words, f"{simulated:.3g} as simulated (real {real:.3g})")
    sheet.print(console)
    console.print()
    for warning in _warnings(bed):
        say(console, f"warning: {warning}", style="yellow")
    say(console, f"Results: {directory}: profile.csv, summary.json, plots/")
    say(console, f'For a case with this vibration: motion.profile = "{directory / "profile.csv"}"')


def _warnings(bed: dict[str, Any]) -> list[str]:
    """What a reader of the result must know about its limits."""
    knudsen = bed.get("knudsen_number", 0.0)
    if knudsen <= SLIP:
        return []
    return [
        f"the gas is rarefied (mean free path {1e6 * bed['mean_free_path']:.3g} um, {knudsen:.2g} times a diameter): the drag is that of "
        "a continuum, which is too large here"
    ]
