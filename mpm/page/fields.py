"""The fields of a run as a page carries them: whole numbers of 12 bits, the change from one stored time to the next, deflated.

A field is shown in one colour range over all times, so 4,095 levels of that range are what a reader can see (three digits under the
pointer) and differences in time are mostly zero: a page with all times is smaller than one `.vtu`. What is still too large loses every
second stored time, then cells are joined two by two; the page says so.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpm.arrays import Floats
from mpm.errors import InputError
from mpm.output.deflate import small
from mpm.output.results import Run
from mpm.output.vtu import Snapshot

Maker = Callable[[Run, Snapshot], Floats]
LEVELS = 4095
"""Levels of a colour range; 0 stands below them for what is less than the smallest value of a logarithmic range, or is not there."""
DECADES = 6
"""Extent of a logarithmic range below its largest value."""
EVEN = 1e-3
"""Relative differences that do not make a picture: a field that is even to this is shown from zero."""
MOST_TIMES, FEWEST_TIMES = 161, 21
"""Stored times that a page carries: at most, and before cells are joined instead."""
MOST_JOINED = 16


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a field is shown: `name` as in the files, label and unit for people, `factor` from SI to that unit, scale and colours."""

    name: str
    label: str
    unit: str
    factor: float
    logarithmic: bool
    colours: str | tuple[tuple[float, str], ...]


@dataclass(frozen=True, eq=False)
class Encoded:
    """One field over the chosen times: `low`, `high` of its range in the shown unit, `data` base64 of the deflated differences."""

    look: Look
    low: float
    high: float
    data: str
    frames: tuple[int, ...]
    """Which stored array belongs to each time: times at which nothing has changed share one."""

    def table(self) -> dict[str, Any]:
        """As the page's script reads it."""
        look = self.look
        return {
            "name": look.name,
            "label": look.label,
            "unit": look.unit,
            "log": look.logarithmic,
            "colours": look.colours,
            "low": self.low,
            "high": self.high,
            "frames": list(self.frames),
            "data": self.data,
        }


def levels(values: NDArray[np.floating], low: float, high: float, logarithmic: bool) -> NDArray[np.uint16]:
    """Values as 1 ... LEVELS between `low` and `high`, beyond them clipped; 0 for NaN and, on a logarithmic range, for less than `low`."""
    shown = np.isfinite(values)
    if logarithmic:
        shown &= values >= low
        place = np.log(np.where(shown, values, low) / low) / np.log(high / low)
    else:
        place = (np.where(shown, values, low) - low) / (high - low)
    found = 1.0 + np.round(np.clip(place, 0.0, 1.0) * (LEVELS - 1))
    return np.where(shown, found, 0.0).astype(np.uint16)


def encode(
    look: Look, series: Sequence[NDArray[np.floating]], bounds: tuple[float, float] | None = None
) -> Encoded:
    """One field at all times, in SI; `bounds` (in the shown unit) to share a range with other runs, else that of the values."""
    low, high = bounds or value_range(look, *extent(look, series))
    stored: list[NDArray[np.uint16]] = []
    frames: list[int] = []
    for values in series:
        level = levels(values / np.float64(look.factor), low, high, look.logarithmic).ravel()
        if not stored or not np.array_equal(level, stored[-1]):
            stored.append(level)
        frames.append(len(stored) - 1)
    changes = [stored[0], *(later - earlier for earlier, later in pairwise(stored))]  # modulo 65536
    whole = np.concatenate(changes).astype("<u2").view(np.uint8).reshape(-1, 2)
    planes = np.ascontiguousarray(
        whole.T
    ).tobytes()  # low bytes, then high bytes: the latter are nearly all alike
    data = base64.b64encode(small(planes)).decode("ascii")
    return Encoded(look, low, high, data, tuple(frames))


def extent(look: Look, series: Iterable[NDArray[np.floating]]) -> tuple[float, float]:
    """Least and largest value over all times, in the shown unit; 0 and 0 where there are none."""
    finite = [values[np.isfinite(values)] for values in series]
    low = min((float(v.min()) for v in finite if v.size), default=0.0) / look.factor
    high = max((float(v.max()) for v in finite if v.size), default=0.0) / look.factor
    return low, high


def value_range(look: Look, low: float, high: float) -> tuple[float, float]:
    """The colour range for an extent: 0 to 1 for a coverage, DECADES below the largest on a logarithmic range, from 0 where it is EVEN."""
    if look.name.startswith("theta_"):
        return 0.0, 1.0
    if look.logarithmic:
        high = high if high > 0.0 else 1.0
        return high * 10.0**-DECADES, high
    if high - low > EVEN * max(abs(low), abs(high)):
        return low, high
    return min(low, 0.0), max(high, 0.0) or (1.0 if low == 0.0 else 0.0)


@dataclass(frozen=True, eq=False)
class Film:
    """The fields of a run at the times that a page shows, in SI, joined `joined` x `joined` cells each.

    `every`: 1 if all stored times are there, 2 if every second ...; `x`, `y` are edges [m], `layer` the number of each row's layer.
    """

    x: Floats
    y: Floats
    layer: NDArray[np.int64]
    times: tuple[float, ...]
    series: Mapping[str, Sequence[NDArray[np.float32]]]
    every: int
    joined: int


def chosen_times(count: int, most: int) -> list[int]:
    """At most `most` of `count` indices, evenly spread, the last one always among them."""
    step = -(-count // most) if count > most else 1
    return list(range((count - 1) % step, count, step)) if count else []


def read_film(
    run: Run,
    wanted: Mapping[str, Maker],
    stored: Collection[str],
    values: int,
    say: Callable[[str], None] = lambda text: None,
) -> Film:
    """Read the stored fields of a run, of each at most about `values` numbers: evenly chosen times, then joined cells.

    `wanted` makes of each snapshot, which holds no more than what is `stored` under these names, an array of cells (rows, columns) or of
    corners (one more each). Times whose file is missing, or damaged in what is read of it, are left out, which one line to
    `say` tells.
    """
    grid = run.grid
    cells = grid.cells
    indices = chosen_times(len(run.times), min(MOST_TIMES, max(FEWEST_TIMES, values // cells)))
    series: dict[str, list[NDArray[np.float32]]] = {name: [] for name in wanted}
    joined = 1
    while cells * len(indices) > values * joined**2 and joined < MOST_JOINED:
        joined *= 2
    rows, columns = (
        joined_edges(grid.y, grid.row_layer, joined),
        joined_edges(grid.x, np.zeros(grid.columns), joined),
    )
    times, lost = [], []
    for index in indices:
        try:
            snapshot = run.snapshot(index, stored)
            made = [make(run, snapshot) for make in wanted.values()]
        except InputError as error:
            lost.append(str(error))
            continue
        times.append(run.times[index])
        for name, field in zip(wanted, made, strict=True):
            series[name].append(_joined(field, grid.x, grid.y, rows, columns).astype(np.float32))
    if lost:
        others = f", and {len(lost) - 1} more of {len(indices)} stored times" if len(lost) > 1 else ""
        say(f"{lost[0]}{others}: left out of the page")
    every = indices[1] - indices[0] if len(indices) > 1 else 1
    layer = grid.row_layer[rows[:-1]]
    return Film(grid.x[columns], grid.y[rows], layer, tuple(times), series, every, joined)


def fewer_times(film: Film) -> Film:
    """Every second time of a film, its last one among them."""
    start = (len(film.times) - 1) % 2
    series = {name: values[start::2] for name, values in film.series.items()}
    return replace(film, times=film.times[start::2], series=series, every=2 * film.every)


def fewer_cells(film: Film) -> Film:
    """Cells joined two by two, within their layers."""
    rows = joined_edges(film.y, film.layer, 2)
    columns = joined_edges(film.x, np.zeros(len(film.x) - 1), 2)
    series = {
        name: [_joined(one, film.x, film.y, rows, columns).astype(np.float32) for one in values]
        for name, values in film.series.items()
    }
    x, y, layer = film.x[columns], film.y[rows], film.layer[rows[:-1]]
    return Film(x, y, layer, film.times, series, film.every, 2 * film.joined)


def joined_edges(edges: Floats, group: NDArray[Any], by: int) -> NDArray[np.int64]:
    """Indices of the edges that remain when cells are joined `by` at a time; cells of different `group` (their layer) stay apart."""
    borders = np.flatnonzero(np.diff(group)) + 1
    starts = [0, *borders.tolist(), len(edges) - 1]
    return np.array(
        [i for first, last in pairwise(starts) for i in range(first, last, by)] + [len(edges) - 1]
    )


def _joined(
    values: NDArray[np.floating], x: Floats, y: Floats, rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> Floats:
    """Means over volume of the cells between the remaining edges; of values at corners those that remain."""
    if len(rows) == len(y) and len(columns) == len(x):
        return np.asarray(values, float)
    if values.shape == (len(y), len(x)):
        return np.asarray(values[np.ix_(rows, columns)], float)
    dy, dx = np.diff(y), np.diff(x)
    weighted = np.add.reduceat(values * dy[:, None] * dx, rows[:-1], axis=0)
    area = np.add.reduceat(dy, rows[:-1])[:, None] * np.add.reduceat(dx, columns[:-1])
    return np.asarray(np.add.reduceat(weighted, columns[:-1], axis=1) / area)
