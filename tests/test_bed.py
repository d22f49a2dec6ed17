"""The sliding bed: whole columns, sites conserved exactly, solids that come back keep their coverage."""

import numpy as np
import pytest

from mpm.mesh.strip import Strip
from mpm.motion.kinematics import BedMotion, step_motion
from mpm.parallel import total
from mpm.transport.columns import MEMORY
from mpm.transport.coverage import Coverage

from .cases import MPI, TINY, zone

COMM = MPI.COMM_WORLD


def marked(changes: dict[str, object] | None = None) -> Coverage:
    """The coverage of solids whose every column and row has its own, the same on any number of ranks."""
    case = zone(changes, TINY)
    strip = Strip(case, COMM)
    bed = Coverage(case, strip)
    rows, columns = len(bed.rows), strip.grid.columns
    first = np.linspace(0.1, 0.9, rows * columns)
    bed.become(bed.scatter.to_local(np.stack([first, 1.0 - first])))
    return bed


def moving(bed: Coverage) -> np.ndarray:
    """Coverage of the first site in the moving layer (rows, columns); collective."""
    return bed.whole()[0, bed.moving_rows]


@pytest.mark.parallel
@pytest.mark.parametrize("inflow", ["fresh", "periodic"])
def test_swinging_back_restores_everything(inflow: str) -> None:
    """Fails when solids that slid out at either end and came back are replaced by fresh ones, or the count of what passed keeps a trace."""
    bed = marked({"geometry.bed_inflow": inflow})
    before = moving(bed)
    for there, back in ((3.2, -3.2), (-2.7, 2.7), (5.0, -9.0), (4.0, 0.0)):
        bed.slide(there * bed.strip.grid.dx)
        bed.slide(back * bed.strip.grid.dx)
    np.testing.assert_array_equal(moving(bed), before)
    np.testing.assert_allclose(bed.passed, 0.0, atol=1e-20)


@pytest.mark.parallel
def test_fresh_solids_enter_on_either_side() -> None:
    """Fails when a column moves by another amount than the bed, fresh solids lack, or forwards and backwards differ."""
    for direction in (1, -1):
        bed = marked()
        before, frit = moving(bed), np.delete(bed.whole()[0], bed.moving_rows, axis=0)
        bed.slide(direction * 2.0 * bed.strip.grid.dx)
        after = moving(bed)
        if direction > 0:
            np.testing.assert_array_equal(after[:, 2:], before[:, :-2])
            assert (after[:, :2] == 1.0).all()
        else:
            np.testing.assert_array_equal(after[:, :-2], before[:, 2:])
            assert (after[:, -2:] == 1.0).all()
        np.testing.assert_array_equal(
            np.delete(bed.whole()[0], bed.moving_rows, axis=0), frit
        )  # the frit stays


@pytest.mark.parallel
def test_sites_that_pass_are_counted() -> None:
    """Fails when initial sites differ from what is in the strip plus what has passed, for either kind, at any position."""
    for inflow in ("fresh", "periodic"):
        bed = marked({"geometry.bed_inflow": inflow})
        initially = total(COMM, bed.content())
        rng = np.random.default_rng(4)
        for _ in range(40):
            bed.slide(rng.normal(0.7, 2.0) * bed.strip.grid.dx)
            np.testing.assert_allclose(total(COMM, bed.content()) + bed.passed, initially, rtol=1e-13)
        if inflow == "periodic":
            assert not bed.passed.any()


@pytest.mark.parallel
def test_position_error_is_below_half_a_column() -> None:
    """Fails when the moved columns drift away from the distance slid: many small steps must equal one large one."""
    bed = marked()
    rng = np.random.default_rng(9)
    distance = 0.0
    for _ in range(300):
        slide = rng.normal(0.02, 0.3) * bed.strip.grid.dx
        distance += slide
        bed.slide(slide)
        assert abs(bed.shifted * bed.strip.grid.dx - distance) <= 0.5 * bed.strip.grid.dx * (1 + 1e-9)
    once = marked()
    once.slide(distance)
    assert once.shifted == bed.shifted


@pytest.mark.parallel
@pytest.mark.parametrize("gamma", [0.0, 0.3])
def test_a_step_is_carried_once_around_exactly(gamma: float) -> None:
    """Fails when carrying a coverage step around the periodic strip smears, shifts or loses it: after one turn it must be the
    same, bit for bit.

    With vibration the bed swings forwards and backwards within each cycle; a bed speed that covers the length in 430 cycles.
    """
    bed = marked({"geometry.bed_inflow": "periodic"})
    length = bed.columns * bed.strip.grid.dx
    cycles = 430
    speed = length * 16.0 / cycles
    case = zone(
        {"motion.gamma": gamma, "motion.bed_velocity": f"{speed!r} m/s", "motion.frequency": "16 Hz"}, TINY
    )
    motion = BedMotion(case.motion)
    step = np.zeros((len(bed.rows), bed.columns))
    step[:, bed.columns // 3 : bed.columns // 2] = 1.0
    bed.become(bed.scatter.to_local(np.stack([step.ravel(), 1.0 - step.ravel()])))
    dt, passed_half = 1.0 / 16.0 / 32, False
    for n in range(32 * cycles):
        moved = bed.slide(step_motion(motion, n * dt, (n + 1) * dt).slide)
        if moved and n > 16 * cycles and not passed_half:
            passed_half = True
            np.testing.assert_array_equal(moving(bed), np.roll(step[bed.moving_rows], bed.shifted, axis=1))
            assert bed.shifted >= bed.columns // 2
    assert bed.distance == pytest.approx(length, rel=1e-10)
    assert passed_half and bed.shifted == bed.columns
    np.testing.assert_array_equal(bed.whole()[0], step)


def test_memory_of_columns_is_bounded() -> None:
    """Fails when a long run keeps every column that ever left."""
    bed = marked()
    for _ in range(3 * MEMORY):
        bed.slide(bed.strip.grid.dx)
    assert len(bed.stored()["right"]) == MEMORY and not len(bed.stored()["left"])


def test_recall_undoes_a_step() -> None:
    """Fails when a rejected step leaves the bed moved: the restart state would not be the last good one."""
    bed = marked()
    bed.slide(1.3 * bed.strip.grid.dx)
    memento, before = bed.memento(), bed.whole()
    bed.slide(4.0 * bed.strip.grid.dx)
    bed.recall(memento)
    np.testing.assert_array_equal(bed.whole(), before)
    assert bed.shifted == 1 and bed.distance == 1.3 * bed.strip.grid.dx and len(bed.stored()["right"]) == 1


def test_capacity_is_s_ns_v() -> None:
    """Fails when sites are not surface per total volume times site density times volume, in bed and frit."""
    bed = marked()
    length = 139.7e-3
    expected = 6.92e-8 * length * (58000.0 * 3e-3 + 1e5 * 1.59e-3)
    assert total(COMM, [bed.capacity.sum()])[0] == pytest.approx(expected, rel=1e-12)
