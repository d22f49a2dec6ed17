"""Lists the points of a sweep: which combinations, with which case, under which name."""

import hashlib
import itertools
import math
import warnings
from dataclasses import dataclass
from typing import Any

from mpm.case.case import Case
from mpm.case.settings import file_in
from mpm.errors import InputError
from mpm.sweep.sweepfile import MOST_POINTS, Axis, Sweep
from mpm.sweep.values import to_number


@dataclass(frozen=True)
class Point:
    """One combination: its levels, their SI numbers, and its case, or why it has none."""

    levels: tuple[Any, ...]
    numbers: tuple[float | str, ...]
    name: str
    """The first 12 digits of the resolved case's content hash; names the point's directory."""
    case: Case | None
    error: str


def _fractions(sweep: Sweep) -> list[list[float]]:
    """`samples` x axes numbers in [0, 1). A Sobol sequence of the same seed only grows with `samples`."""
    from scipy.stats import qmc

    sampler = qmc.Sobol if sweep.method == "sobol" else qmc.LatinHypercube
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a number of samples that is no power of two is allowed
        drawn: list[list[float]] = sampler(d=len(sweep.axes), rng=sweep.seed).random(sweep.samples).tolist()
    return drawn


def combinations(sweep: Sweep) -> list[tuple[Any, ...]]:
    """The levels of every combination that the conditions keep; grids run through the last axis first."""
    axes = sweep.axes
    if sweep.mode == "grid":
        size = math.prod(len(axis.levels) for axis in axes)
        if size > MOST_POINTS:
            raise InputError.at(
                sweep.path, "sweep.axis", f"a grid of {size} points", f"at most {MOST_POINTS}"
            )
        everything = list(itertools.product(*(axis.levels for axis in axes)))
    elif sweep.mode == "zip":
        everything = list(zip(*(axis.levels for axis in axes), strict=True))
    else:
        everything = [tuple(map(Axis.draw, axes, row)) for row in _fractions(sweep)]
    kept = []
    for levels in everything:
        values = {axis.name: to_number(level)[0] for axis, level in zip(axes, levels, strict=True)}
        try:
            if all(condition.holds(values) for condition in sweep.conditions):
                kept.append(levels)
        except InputError as error:
            raise InputError(f"{sweep.path}: sweep.where: {error}") from None
    if not kept:
        raise InputError.at(
            sweep.path, "sweep.where", f"drops all {len(everything)} combinations", "one that keeps some"
        )
    return kept


def plan(sweep: Sweep) -> list[Point]:
    """Every point with its case, in order.

    A combination that the case refuses (a port beyond the strip, say) is a point with an error, for the table.
    When the case refuses all of them, or an axis changes nothing in it (the bed speed where a profile file rules), the
    sweep file is at fault: InputError.
    """
    points = []
    for levels in combinations(sweep):
        folder = sweep.path.resolve().parent
        overrides = {
            key: file_in(folder, key, level)
            for axis, level in zip(sweep.axes, levels, strict=True)
            for key in axis.keys
        }
        numbers = tuple(to_number(level)[0] for level in levels)
        try:
            case = sweep.base.with_(overrides)
        except InputError as error:
            refused = hashlib.sha256(repr((sweep.base.content_hash(), overrides)).encode()).hexdigest()
            points.append(Point(levels, numbers, refused[:12], None, str(error)))
        else:
            points.append(Point(levels, numbers, case.content_hash()[:12], case, ""))
    _refuse_equal_cases(sweep, points)
    if all(point.case is None for point in points):
        raise InputError(f"{sweep.path}: every point is refused, the first: {points[0].error}")
    return points


def _refuse_equal_cases(sweep: Sweep, points: list[Point]) -> None:
    """Two points that differ in the table but not in their case would share a directory and show an effect that there is not."""
    seen: dict[str, Point] = {}
    for point in points:
        other = seen.setdefault(point.name, point)
        if other.numbers != point.numbers:
            axes = [
                f"{axis.name} = {first} and {second}"
                for axis, first, second in zip(sweep.axes, other.levels, point.levels, strict=True)
                if first != second
            ]
            raise InputError.at(
                sweep.path,
                "sweep.axis",
                f"{', '.join(axes)}, which give the same case",
                "axes that change the case",
            )
