"""Kills, interruptions, resumes, extensions: nothing finished is lost, nothing finished is computed again."""

import os
import re
import signal
from collections import Counter
from typing import Any

import pytest

from .conftest import Bench

SPEEDS = ("0.5 cm/s", "1.3 cm/s", "2 cm/s", "3 cm/s")


def test_a_killed_driver_loses_nothing_and_leaves_nothing(bench: Bench) -> None:
    """SIGKILL of the driver. Fails when a point goes on computing, or a finished or started one begins anew."""
    bench.delay = 1.5
    bench.sweep("[0.1, 0.2, 0.3, 0.4, 0.5]")
    driver = bench.start()
    bench.wait_for(lambda: len(bench.events("start")) == 4 and len(bench.events("step")) > 45)
    bench.wait_for(lambda: "done" in set(bench.table().status))  # for those who look on
    driver.kill()
    driver.wait()
    finished = set(bench.names("stop"))
    points = {int(event[1]) for event in bench.events("start")}
    bench.wait_for(lambda: not any(bench.alive(pid) for pid in points), 10.0)
    assert finished and len(bench.names("start")) < 5
    status, messages = bench.run()
    assert status == 0, messages
    assert f"{len(finished)} of 5 points are finished already" in messages
    starts = bench.names("start")
    assert all(starts[name] == 1 for name in finished)
    interrupted = {event[0] for event in bench.events("interrupted")}
    assert (
        interrupted and {event[0] for event in bench.events("start") if event[3] == "resume"} == interrupted
    )
    assert set(bench.names("step").values()) == {20}, "steps were lost or repeated"
    bench.run("reference")
    assert bench.text() == bench.text("reference")


def test_a_killed_point_goes_on_where_it_was(bench: Bench) -> None:
    """SIGKILL of a point. Fails when the others suffer, or the next call repeats what was finished or saved."""
    bench.delay = 1.0
    bench.sweep("[0.1, 0.2, 0.3]")
    driver = bench.start()
    bench.wait_for(lambda: len(bench.events("step")) > 8)
    victim, pid, *_ = bench.events("start")[0]
    os.kill(int(pid), signal.SIGKILL)
    _, messages = driver.communicate(timeout=60)
    assert driver.returncode == 3, messages
    assert bench.table().set_index("point").status.to_dict()[victim] == "killed"
    assert Counter(bench.table().status) == {"done": 2, "killed": 1}
    assert bench.run()[0] == 0
    assert bench.names("start") == {name: 2 if name == victim else 1 for name in bench.names("start")}
    assert bench.names("step")[victim] in (19, 20)  # killed between saving a step and noting it
    assert set(bench.table().status) == {"done"}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_stops_points_and_keeps_their_state(bench: Bench, number: Any) -> None:
    """Fails when the exit status is not 130, a point survives, or the table does not tell how far it came."""
    bench.delay = 1.0
    bench.sweep("[0.1, 0.2, 0.3, 0.4]")
    driver = bench.start()
    bench.wait_for(lambda: len(bench.events("stop")) == 2 and len(bench.events("start")) == 4)
    driver.send_signal(number)
    _, messages = driver.communicate(timeout=20)
    assert driver.returncode == 130, messages
    assert not any(bench.alive(int(event[1])) for event in bench.events("start"))
    assert Counter(bench.table().status) == {"done": 2, "interrupted": 2}
    assert bench.run()[0] == 0
    assert set(bench.names("step").values()) == {20} and set(bench.table().status) == {"done"}


def test_extension_by_one_value_computes_only_that(bench: Bench) -> None:
    """Fails when a finished point of the smaller grid runs again."""
    bench.sweep("[0.1, 0.2]", SPEEDS[:2])
    assert bench.run()[0] == 0
    before = bench.names("start")
    bench.sweep("[0.1, 0.15, 0.2]", SPEEDS[:2])
    status, messages = bench.run()
    assert status == 0 and "4 of 6 points are finished already" in messages
    new = bench.names("start") - before
    assert set(bench.table()[bench.table().gamma == 0.15].point) == set(new) and set(new.values()) == {1}
    assert list(bench.table().gamma) == [0.1, 0.1, 0.15, 0.15, 0.2, 0.2]


def test_a_changed_case_and_a_changed_program_are_said(bench: Bench) -> None:
    """Fails when old results would silently mix with new ones."""
    bench.sweep("[0.1, 0.77]")
    assert bench.run()[0] == 0
    for record in (bench.path / "out" / "driver").glob("*.json"):
        record.write_text(re.sub(r"mpm [^\"]*", "mpm 0.0.9 (00000000)", record.read_text()))
    _, messages = bench.run()
    assert "the program has changed: 1 finished points were computed by mpm 0.0.9 (00000000)" in messages
    assert "another output directory" in messages
    assert bench.names("start")[bench.table().point[0]] == 1  # done: kept
    assert bench.names("start")[bench.table().point[1]] == 2  # failed: a changed program may cure it
    bench.sweep("[0.1, 0.77]", tail='[sweep.set]\n"time.end" = "3 s"\n')
    _, messages = bench.run()
    assert "the base case or its fixed overrides have changed since the last call" in messages
    assert (
        "2 earlier points in" in messages
        and "do not belong to this sweep any more; they are kept" in messages
    )


def test_a_point_that_the_disk_failed_is_tried_again(bench: Bench) -> None:
    """Fails when want of disk space counts as the point's own numerical failure, a verdict that keeps it from being run again."""
    bench.sweep("[0.1, 0.44, 0.77]")
    for attempts in (1, 2):
        status, messages = bench.run()
        assert status == 3, messages
        table = bench.table().set_index("gamma")
        assert table.status.tolist() == ["done", "crashed", "failed"]
        assert "No space left on device" in table.error[0.44]
        starts = bench.names("start")
        assert starts[table.point[0.44]] == attempts and starts[table.point[0.77]] == 1


def test_a_profile_that_changes_ends_the_sweep_and_makes_new_points(bench: Bench) -> None:
    """Fails when points that were named after one profile file run with another, or the next call takes their results over."""
    profile = bench.path / "p.csv"

    def write(speed: float) -> None:
        rows = "".join(f"{phase},{speed},0,1\n" for phase in range(0, 360, 30))
        profile.write_text(f"phase_deg,u_x_m/s,u_y_m/s,contact\n{rows}")

    write(0.01)
    bench.delay = 1.0
    fixed = f'[sweep.set]\n"motion.profile" = "{profile}"\n'
    (bench.path / "sweep.toml").write_text(
        '[sweep]\ncase = "single_zone"\npictures = []\n[[sweep.axis]]\nkey = "motion.gamma"\nname = "gamma"\n'
        f"values = [0.1, 0.2, 0.3]\n{fixed}"
    )
    driver = bench.start(jobs=1)
    bench.wait_for(lambda: len(bench.events("step")) > 3)
    write(0.02)
    _, messages = driver.communicate(timeout=60)
    assert driver.returncode == 2 and f"{profile} has changed" in messages.splitlines()[-1], messages
    assert len(bench.events("start")) == 1
    bench.delay = 0.1
    assert bench.run()[0] == 0
    assert set(bench.table().status) == {"done"} and len(bench.names("start")) == 4
