"""What a sweep leaves: the table in its three forms, `load_sweep`, pictures."""

import errno
import json
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pandas as pd
import pytest

import mpm
from mpm.errors import InputError
from mpm.report.quantities import unit_of
from mpm.report.trees import flatten
from mpm.sweep import driver
from mpm.sweep.cluster import Pool
from mpm.sweep.layout import Layout
from mpm.sweep.plan import plan
from mpm.sweep.results import Results
from mpm.sweep.sweepfile import read_sweep

from .conftest import Bench

SPEEDS = ("0.5 cm/s", "1.3 cm/s", "2 cm/s", "3 cm/s")


def test_load_sweep_returns_a_grid_with_units(bench: Bench) -> None:
    """Fails when values sit at wrong coordinates, units are lost, or a failed point is a number."""
    bench.sweep(
        "[0.3, 0.77]", SPEEDS[:3], more='title = "speeds"\nwhere = ["gamma < 0.5 or speed < \'1 cm/s\'"]'
    )
    assert bench.run()[0] == 0
    data = mpm.load_sweep(bench.path / "out")
    assert dict(data.sizes) == {"gamma": 2, "speed": 3}
    assert data.speed.attrs["units"] == "m/s" and data["cvd.rate_mean"].attrs["units"] == "mol/m^3/s"
    assert data["titration.tma.exit_mean"].sel(gamma=0.3, speed=0.013).item() == 0.3 * 0.013
    assert data.status.sel(gamma=0.77).values.tolist() == ["failed", "", ""]
    assert np.isnan(data["cvd.rate_mean"].sel(gamma=0.77)).all()
    assert data.attrs["title"] == "speeds" and data.attrs["program"].startswith("mpm ")


def test_load_sweep_returns_samples_as_a_frame(bench: Bench) -> None:
    """Fails when a sample's frame differs from the table, or csv, parquet and provenance disagree."""
    bench.sweep("[0.1, 0.2]", SPEEDS, more='mode = "sample"\nsamples = 4')
    assert bench.run()[0] == 0
    frame = mpm.load_sweep(bench.path / "out")
    assert len(frame) == 4 and frame.attrs["units"]["speed"] == "m/s"
    parquet = pd.read_parquet(bench.path / "out" / "results.parquet")
    assert list(parquet.columns) == list(frame.columns)
    for column in frame.columns:
        assert frame[column].tolist() == parquet[column].tolist()
    import pyarrow.parquet

    schema = pyarrow.parquet.read_schema(bench.path / "out" / "results.parquet")
    assert schema.field("speed").metadata == {b"unit": b"m/s"}
    about = json.loads((bench.path / "out" / "sweep.json").read_text())
    assert about["counts"] == {"done": 4} and about["columns"]["speed"]["unit"] == "m/s"
    assert about["text"] == (bench.path / "sweep.toml").read_text()
    with pytest.raises(mpm.InputError, match="no sweep"):
        mpm.load_sweep(bench.path)


@pytest.mark.parametrize(
    ("gammas", "speeds", "more"),
    [
        ("[0.1, 0.2, 0.77]", SPEEDS[:1], ""),
        ("[0.1, 0.2, 0.77]", SPEEDS[:3], ""),
        ("[0.1, 0.2]", SPEEDS[:2], 'mode = "zip"'),
        ("[0.1, 0.2, 0.4]", SPEEDS, 'mode = "sample"\nsamples = 4'),
    ],
    ids=["lines", "map", "zip", "parallel"],
)
def test_pictures(bench: Bench, gammas: Any, speeds: Any, more: Any) -> None:
    """Fails when a kind of sweep, or a failed point in it, gives no picture."""
    bench.delay = 0.0
    bench.sweep(gammas, speeds, more, pictures="cvd.*")
    status, messages = bench.run()
    assert status == 0, messages
    (picture,) = (bench.path / "out" / "plots").glob("*.png")
    assert picture.name == "cvd.rate_mean.png" and picture.stat().st_size > 5000


def test_a_cut_table_is_refused_and_nan_is_an_empty_cell(bench: Bench) -> None:
    """Fails when a number that lost its digits is read, or a NaN of an edited summary reaches the table."""
    bench.sweep("[0.1, 0.2]")
    assert bench.run()[0] == 0
    table = bench.path / "out" / "results.csv"
    whole = table.read_text()
    for text in ("", whole[: len(whole) // 3], whole.replace("status", "state"), whole.rstrip("\n")):
        table.write_text(text)
        with pytest.raises(InputError, match="a table that is cut"):
            mpm.load_sweep(bench.path / "out")
    assert flatten({"a": float("nan"), "b": [1.0, float("inf")], "c": 2}) == {"b.0": 1.0, "c": 2}


def test_a_table_that_cannot_be_written_stops_no_point(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a full disk ends the driver while points still run, or large tables are written back to back."""
    calls = []

    def full(*_: object) -> None:
        calls.append(time.monotonic())
        time.sleep(0.05)
        raise OSError(errno.ENOSPC, "No space left on device")

    bench.sweep("[0.1]")
    sweep = read_sweep(bench.path / "sweep.toml")
    collector = driver.Collector(
        Results(sweep, plan(sweep), Layout(bench.path / "out")),
        Pool(ThreadPoolExecutor(1), lambda: 1, ""),
        False,
    )
    monkeypatch.setattr(driver, "write_csv", full)
    monkeypatch.setattr(driver, "SAVE_EVERY", 0.0)
    collector._save()
    assert "No space left on device" in capsys.readouterr().err
    assert collector._next_save >= calls[0] + 0.05 / driver.SAVE_SHARE


def test_every_dimensional_number_of_the_flow_has_its_unit() -> None:
    """Fails when the flow of an outlet or the drop over a layer is called a pure number, in sweep.json and on the screen."""
    assert unit_of("flow.outlets.zone1", steady=False) == unit_of("flow.inflow", steady=False) == "m^2/s"
    assert (
        unit_of("flow.pressure_drop.bed", steady=True)
        == unit_of("flow.bed_pressure_drop", steady=True)
        == "Pa"
    )
    assert unit_of("flow.mass_error", steady=False) == "1"
