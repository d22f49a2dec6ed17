"""Doses that reach a wanted titration with the least precursor and the least parasitic CVD (`mpm optimise`).

    minimise  (precursor fed + weight * CVD events) / precursor fed by the saturating doses
    subject to  exit_mean of every dosed inlet's titration >= target

over logarithms of mass fractions and, on request, port velocities; each point is one steady state. Where all precursor is consumed the
exit coverage is the dose ratio, so the search starts there. scipy's COBYQA needs no derivatives: the exit coverage has a kink where
precursor begins to leave.
"""

from __future__ import annotations

import csv
import io
import logging
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from mpm.advice.doses import Dose, checked_doses
from mpm.case.kinds import SEARCH, kind_of_directory, what_it_is
from mpm.errors import ConvergenceError, InputError
from mpm.files import write_atomically
from mpm.reactor.flow import Flow
from mpm.reactor.reactor import Reactor
from mpm.report.dosing import inlet_excess

if TYPE_CHECKING:
    from mpm.case.case import Case

log = logging.getLogger("mpm")
STEP = 0.1
"""First step of the search, in powers of e."""
CLOSE = 1e-3
"""Relative change of the doses at which the search ends."""
SLACK = 1e-4
"""Titration that may be missing."""
MARGIN = 1e-3
"""By how much the search aims higher, for its own tolerance."""
UNSOLVED = 1e3
"""Cost of doses whose steady state was not found; the first point costs about 1."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """One steady state: the doses by key; by inlet the mean exit coverage `exits`, the dose `ratios` and the `excess` numbers (molecules
    per site); `fed` precursor and `cvd` events [mol per metre of depth and second]."""

    doses: Mapping[str, float]
    exits: Mapping[str, float]
    ratios: Mapping[str, float]
    excess: Mapping[str, float]
    fed: float
    cvd: float

    def reaches(self, target: float) -> bool:
        return min(self.exits.values()) >= target - SLACK


class Search:
    """Steady states of `case` at chosen doses; every one is kept in `points`. The flow is found again only when a velocity changes."""

    def __init__(self, case: Case, doses: list[Dose], target: float, weight: float):
        self.case, self.doses, self.fidelity = case.with_({"fidelity": "steady"}), doses, case.fidelity
        self.target, self.weight = target, weight
        self.points: list[Point] = []
        self._flow: tuple[tuple[float, ...], Flow] | None = None  # of these inlet velocities
        self._known: dict[tuple[float, ...], Point | None] = {}

    def case_at(self, values: Mapping[str, float]) -> Case:
        return self.case.with_({dose.key: dose.setting(values[dose.key]) for dose in self.doses})

    def point(self, logs: NDArray[np.float64]) -> Point | None:
        """The steady state at exp(logs) of the doses; None where it is not found."""
        key = tuple(float(v) for v in np.exp(logs))
        if key not in self._known:
            self._known[key] = self._solve(key)
        return self._known[key]

    def _solve(self, values: tuple[float, ...]) -> Point | None:
        doses = {dose.key: value for dose, value in zip(self.doses, values, strict=True)}
        try:
            case = self.case_at(doses)
        except InputError as error:  # such as a velocity whose gas would carry the bed away
            log.warning("optimise: %s", error)
            return None
        velocities = tuple(inlet.velocity for inlet in case.geometry.inlets)
        known = self._flow[1] if self._flow is not None and self._flow[0] == velocities else None
        if case.energy is not None:
            known = None  # it follows the temperatures that its own doses make
        reactor = Reactor(case, flow=known)
        try:
            summary = reactor.run().summary
        except ConvergenceError as error:
            log.warning("optimise: %s", error)
            return None
        self._flow = (velocities, reactor.flow)
        found = (inlet_excess(case, inlet) for inlet in case.geometry.inlets)
        dosed = dict.fromkeys(excess.species for excess in found if excess is not None)
        point = Point(
            doses=doses,
            exits={name: entry["exit_mean"] for name, entry in summary["titration"].items()},
            ratios=summary.get("dose_ratio", {}),
            excess=summary["excess_number"],
            fed=sum(summary["species"][name]["fed"] for name in dosed),
            cvd=summary.get("cvd", {}).get("total", 0.0),  # absent without a gas-phase reaction
        )
        self.points.append(point)
        return point

    def cost(self, point: Point) -> float:
        """Precursor and CVD over what the first point, the saturating doses, feeds."""
        return (point.fed + self.weight * point.cvd) / self.points[0].fed

    def best(self) -> Point | None:
        """The cheapest point that reaches the target."""
        return min((p for p in self.points if p.reaches(self.target)), key=self.cost, default=None)

    def found(self) -> Point:
        """The best point. Raises ConvergenceError when no dose has reached the target, with how near the search came and why it ended."""
        best = self.best()
        if best is not None:
            return best
        nearest = max(self.points, key=lambda p: min(p.exits.values()))
        exits = ", ".join(f"{name} {value:.4f}" for name, value in nearest.exits.items())
        richest = [d.key for d in self.doses if nearest.doses[d.key] > 0.99 * d.highest]
        limited = f"; the highest dose that is tried is reached: {', '.join(richest)}" if richest else ""
        raise ConvergenceError(
            f"optimise: the target is not reached: none of {states(len(self.points))} has a coverage of {self.target:g} at every "
            f"exit; the nearest has {exits}{limited}; try a lower --target, a higher --limit, --velocities, or a slower bed"
        )

    def best_case(self) -> Case:
        """The case as it was given, with the best doses."""
        return self.case_at(self.found().doses).with_({"fidelity": self.fidelity})

    def run(self, limit: int, watch: Callable[[Point], None] = lambda point: None) -> None:
        """Look for the cheapest doses with `limit` steady states at most; all are kept in `points`, and told to `watch`.

        Raises ConvergenceError when the first one is not found.
        """
        aim = min(self.target + MARGIN, 0.5 * (1.0 + self.target))

        def solved(logs: NDArray[np.float64]) -> Point | None:
            before = len(self.points)
            point = self.point(logs)
            if len(self.points) > before:
                watch(self.points[-1])
            return point

        def cost(logs: NDArray[np.float64]) -> float:
            point = solved(logs)
            return self.cost(point) if point else UNSOLVED

        def lacking(logs: NDArray[np.float64]) -> NDArray[np.float64]:
            """Titration above the aim, by inlet."""
            point = solved(logs)
            if point is None:
                return np.full(len(self.points[0].exits), -1.0)
            return np.array(list(point.exits.values())) - aim

        start = np.log([d.start for d in self.doses])
        if solved(start) is None:
            raise ConvergenceError(
                "optimise: the steady state at the first doses was not found; try another mesh"
            )
        minimize(
            cost,
            start,
            method="COBYQA",
            bounds=[(np.log(d.lowest), np.log(d.highest)) for d in self.doses],
            constraints={"type": "ineq", "fun": lacking},
            options={"maxfev": limit, "initial_tr_radius": STEP, "final_tr_radius": CLOSE},
        )


def optimise(
    case: Case,
    target: float = 0.99,
    weight: float = 10.0,
    velocities: bool = False,
    limit: int = 80,
    watch: Callable[[Point], None] = lambda point: None,
) -> tuple[Point, Case, Search]:
    """Best doses, the case with them, and the whole search.

    `weight`: moles of precursor that one mole of CVD is worth; `limit`: steady states at most. Raises InputError, and ConvergenceError
    when no dose within bounds reaches the target.
    """
    search = Search(case, checked_doses(case, target, weight, velocities, limit), target, weight)
    search.run(limit, watch)
    return search.found(), search.best_case(), search


def states(number: int) -> str:
    """A number of steady states in words."""
    return f"{number} steady state{'' if number == 1 else 's'}"


def make_directory(directory: Path) -> None:
    """Make the directory of the results, before the search that would be lost; InputError when nothing can be written there, or when
    something else than an earlier search is there."""
    try:
        if directory.is_dir() and any(directory.iterdir()) and kind_of_directory(directory) is not SEARCH:
            raise InputError.at(
                directory, "", what_it_is(directory), "a new directory, or that of an earlier search (-o DIR)"
            )
        directory.mkdir(parents=True, exist_ok=True)
        for name in (
            "case.toml",
            "points.csv",
            "over.csv",
        ):  # of an earlier search, whose doses this one may not reach
            (directory / name).unlink(missing_ok=True)
        tempfile.TemporaryFile(dir=directory).close()
    except OSError as error:
        raise InputError(f"{directory}: cannot be used as output directory ({error.strerror})") from None


def write_points(directory: Path, search: Search) -> None:
    """`points.csv`: every steady state [SI]."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    first = search.points[0]
    names = [f"titration.{inlet}.exit_mean" for inlet in first.exits]
    names += [f"{kind}.{inlet}" for kind in ("dose_ratio", "excess_number") for inlet in first.exits]
    table.writerow([*first.doses, *names, "fed", "cvd.total", "cost"])
    for point in search.points:
        groups = (
            point.exits,
            point.ratios,
            point.excess,
        )  # of a ratio that does not exist the place stays empty
        values = [*point.doses.values(), *(group.get(inlet, "") for group in groups for inlet in first.exits)]
        table.writerow([*values, point.fed, point.cvd, search.cost(point)])
    write_atomically(directory / "points.csv", text.getvalue())
