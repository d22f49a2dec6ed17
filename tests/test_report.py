"""The report pages: their numbers are the run's, they need no network, and in a browser they do what they show."""

import csv
import errno
import json
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mpm import InputError, Reactor, load_case, load_run
from mpm.cli import main
from mpm.page import report
from mpm.page.compare_page import compare_page, key_table, number_table
from mpm.page.curves import curves
from mpm.page.fields import (
    DECADES,
    LEVELS,
    Look,
    chosen_times,
    encode,
    joined_edges,
    levels,
    value_range,
)
from mpm.page.numbers import accounts, groups
from mpm.page.run_page import run_page
from mpm.page.strip import LETTER, drawing
from mpm.page.sweep_page import sweep_page
from mpm.report.trees import flatten
from mpm.report.verdict import percent, verdict
from mpm.sweep.layout import Layout
from tests.cases import COARSE, SHORT, TINY

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
LARGEST = 10_000_000
"""Bytes of a page, at most."""
TITLE = 'A zone </script><b id="injected">& "quotes"'


@pytest.fixture(scope="module")
def zone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A coarse zone whose case types nothing but its mesh, a dose and a title that must be escaped."""
    directory = tmp_path_factory.mktemp("report") / "zone"
    changes = {**COARSE, **SHORT, "title": TITLE, "geometry.inlet.tma.mass_fractions.TMA": 1e-3}
    Reactor(load_case("single_zone", changes)).run(directory)
    return directory


@pytest.fixture(scope="module")
def weaker(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with half the dose."""
    directory = tmp_path_factory.mktemp("report") / "weaker"
    changes = {**COARSE, **SHORT, "geometry.inlet.tma.mass_fractions.TMA": 5e-4}
    Reactor(load_case("single_zone", changes)).run(directory)
    return directory


@pytest.fixture(scope="module")
def cycle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A coarse cycle of TMA and water."""
    directory = tmp_path_factory.mktemp("report") / "cycle"
    Reactor(load_case("single_cycle", {**COARSE, **SHORT})).run(directory)
    return directory


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two doses times two bed speeds of a tiny zone."""
    folder = tmp_path_factory.mktemp("report")
    settings = {**TINY, "time.end": "0.2 s", "time.step": "0.1 s"}
    (folder / "map.toml").write_text(
        '[sweep]\ncase = "single_zone"\ntitle = "Dose and speed"\nmode = "grid"\n'
        '[[sweep.axis]]\nkey = "geometry.inlet.tma.mass_fractions.TMA"\nvalues = [1e-4, 2e-4]\n'
        '[[sweep.axis]]\nkey = "motion.bed_velocity"\nvalues = ["1 cm/s", "2 cm/s"]\n[sweep.set]\n'
        + "".join(f"{json.dumps(key)} = {json.dumps(value)}\n" for key, value in settings.items())
    )
    assert main(["sweep", str(folder / "map.toml"), "-o", str(folder / "map"), "-j", "2"]) == 0
    return folder / "map"


class Page:
    """A page in a browser, with what it complained of."""

    def __init__(self, browser: Any, path: Path) -> None:
        self.page = browser.new_page(viewport={"width": 1300, "height": 900})
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.resolve().as_uri())
        self.page.wait_for_function("document.body.dataset.ready", timeout=120_000)

    def __call__(self, script: str) -> Any:
        return self.page.evaluate(script)

    def numbers(self) -> dict[str, float]:
        """Every number on the page that says which it is."""
        found = self(
            "[...document.querySelectorAll('[data-name]')].map(e => [e.dataset.name, Number(e.dataset.value)])"
        )
        return dict(found)

    def move(self, index: int) -> None:
        """Set the time slider as a reader would, and wait for the picture."""
        self(
            f"(() => {{ const s = document.querySelector('.slider'); s.value = {index}; s.dispatchEvent(new Event('input')); }})()"
        )
        self.page.wait_for_function(
            f"document.querySelector('.viewer').dataset.index == {index}", timeout=60_000
        )


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if BROWSER is None:
        missing = pytest.fail if os.environ.get("MPM_NEED_BROWSER") else pytest.skip
        missing("no Chromium is installed")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
        yield chromium
        chromium.close()


def alone(page: Page) -> bool:
    """Whether the page complained of nothing and asked for nothing but itself."""
    outside = [url for url in page.requests if not url.startswith(("file:", "blob:", "data:"))]
    assert (page.complaints, outside, page("document.body.dataset.ready")) == ([], [], "yes")
    return True


@pytest.mark.browser
@pytest.mark.parametrize("which", ["zone", "cycle"])
def test_the_numbers_of_the_page_are_those_of_the_summary(
    which: str, request: pytest.FixtureRequest, browser: Any
) -> None:
    """Fails when a number on the page is not in summary.json, a number of it is missing there, or the page is too large."""
    directory: Path = request.getfixturevalue(which)
    path = load_run(directory).report()
    assert path == directory / "report.html" and path.stat().st_size < LARGEST
    page = Page(browser, path)
    assert alone(page)
    summary = flatten(json.loads((directory / "summary.json").read_text()))
    shown = page.numbers()
    assert {name: summary[name] for name in shown} == shown
    absent = {n for n, v in summary.items() if n not in shown and not n.startswith("versions") and v != 0.0}
    assert {n for n in absent if ".exit_profile." not in n and not n.endswith("bed_pressure_drop")} <= {
        "flow.frit_pressure_drop"
    }


@pytest.mark.browser
def test_the_slider_moves_the_picture(zone: Path, browser: Any) -> None:
    """Fails when another time shows the same fields, a colour range moves with it, or a value is not the file's."""
    page = Page(browser, report(zone))
    run = load_run(zone)
    look = (
        "(() => { const t = viewers[0].plots[1].data[0]; return [t.z.map(r => [...r]), t.zmin, t.zmax]; })()"
    )
    ranges = set()
    for index in (0, 2, len(run.times) - 1):
        page.move(index)
        z, low, high = page(look)
        ranges.add((low, high))
        stored = run.field(run.snapshot(index), "x_TMA")
        seen = stored > 10.0**low
        shown = np.array(z, float)
        assert shown.shape == stored.shape
        assert (
            np.abs(10.0 ** shown[seen] / stored[seen] - 1.0).max(initial=0.0)
            < 0.5 * (10.0 ** (DECADES / LEVELS) - 1.0) + 1e-5
        )
        assert (shown[~seen] < low).all()
    assert len(ranges) == 1
    pictures = []
    for index in (1, len(run.times) - 1):
        page.move(index)
        page.page.wait_for_timeout(200)
        pictures.append(page.page.locator(".viewer .plot").first.screenshot())
    assert pictures[0] != pictures[1]
    assert alone(page)


@pytest.mark.browser
def test_every_field_streamlines_and_zoom_can_be_chosen(cycle: Path, browser: Any) -> None:
    """Fails when a choice in a list draws something else or nothing."""
    page = Page(browser, report(cycle))
    names = page("viewers[0].fields.map(f => f.name)")
    assert {"x_TMA", "x_H2O", "x_CH4", "velocity", "pressure"} <= set(names)
    for name in names:
        page(
            f"(async () => {{ viewers[0].selects[0].value = {json.dumps(name)}; await viewers[0].draw(true); }})()"
        )
        assert page("viewers[0].plots[0].dataset.field") == name
        assert page("viewers[0].plots[0].data.length") == 1
    page("(async () => { viewers[0].streams.checked = true; await viewers[0].draw(true); })()")
    assert page("viewers[0].plots[0].data[1].type") == "contour"
    layers = load_run(cycle).case.geometry.layers
    page(f"(() => {{ viewers[0].zoom.value = {len(layers) - 1}; viewers[0].look(); }})()")
    low, high = page("viewers[0].plots[0].layout.yaxis.range")
    assert high - low == pytest.approx(1e3 * layers[-2].height)
    assert alone(page)


@pytest.mark.browser
def test_a_name_cannot_become_markup(zone: Path, browser: Any) -> None:
    """Fails when a title of the case is taken for HTML or ends the script."""
    page = Page(browser, report(zone))
    assert page("document.title") == TITLE
    assert page("document.querySelector('h1').textContent") == TITLE
    assert page("document.getElementById('injected')") is None
    assert page("document.getElementById('casefile').textContent") == (zone / "case.toml").read_text()


@pytest.mark.browser
def test_two_runs_side_by_side(zone: Path, weaker: Path, browser: Any) -> None:
    """Fails when the page of two runs hides what was changed, uses two colour scales, or shows another difference."""
    page = Page(browser, report([zone, weaker]))
    assert alone(page)
    keys = page("[...document.querySelectorAll('#keys td:first-child')].map(e => e.textContent)")
    assert keys == ["geometry.inlet.tma.mass_fractions.TMA"]
    shown = page(
        "[...document.querySelectorAll('#numbers tr')].map(r => [...r.querySelectorAll('[data-value]')].map(e => Number(e.dataset.value)))"
    )
    summaries = [flatten(load_run(one).summary) for one in (zone, weaker)]
    pair = [summaries[0]["excess_number.tma"], summaries[1]["excess_number.tma"]]
    assert pair in shown
    ranges = page("viewers[0].plots.slice(0, 2).map(p => [p.data[0].zmin, p.data[0].zmax])")
    assert ranges[0] == ranges[1]
    fields = [run.field(run.snapshot(-1), "theta_OAl(CH3)2") for run in map(load_run, (zone, weaker))]
    porous = np.array([layer.material is not None for layer in load_run(zone).case.geometry.layers])
    largest = np.abs(fields[1] - fields[0])[porous[load_run(zone).grid.row_layer]].max()
    assert page("Number(viewers[0].plots[2].dataset.largest)") == pytest.approx(largest, abs=1.1 / LEVELS)
    for steps, seen in ((1.0, False), (3.0, True)):  # one level of the page's own encoding is no difference
        found = page(
            f"""(async () => {{
                const field = {{ low: 0, high: 10, log: false, label: "p", unit: "Pa" }}, v = viewers[0], [one] = v.runs;
                const values = (p) => Array.from({{ length: one.rows }}, () => Array(one.columns).fill(p));
                await v.drawDifference([{{ field, values: values(5) }}, {{ field, values: values(5 + {steps} * 10 / 4094) }}]);
                return Number(v.plots[2].dataset.largest) > 0;
            }})()"""
        )
        assert found is seen
    page.move(0)
    assert page("Number(viewers[0].plots[2].dataset.largest)") == 0.0


@pytest.mark.browser
def test_points_of_a_sweep_open_their_runs(sweep: Path, browser: Any) -> None:
    """Fails when a map of a sweep shows other numbers than its table, or a point does not lead to the page of its run."""
    page = Page(browser, report(sweep))
    assert alone(page)
    rows = list(csv.DictReader((sweep / "results.csv").open()))
    name = page("viewers[0].plots[0].dataset.number")
    assert name in rows[0]
    trace = page(
        "(() => { const t = viewers[0].plots[0].data[0]; return [t.type, t.x, t.y, t.z, t.customdata]; })()"
    )
    kind, doses, speeds, values, pages = trace
    assert (kind, doses, speeds) == ("heatmap", [1e-4, 2e-4], [1.0, 2.0])
    for row in rows:
        i = speeds.index(pytest.approx(100.0 * float(row["motion.bed_velocity"])))
        j = doses.index(float(row["geometry.inlet.tma.mass_fractions.TMA"]))
        assert values[i][j] == pytest.approx(float(row[name]), rel=1e-5)
        assert pages[i][j] == f"points/{row['point']}/report.html"
    page(
        "viewers[0].plots[0].open({ points: [{ customdata: viewers[0].plots[0].data[0].customdata[1][0] }] })"
    )
    page.page.wait_for_function(
        "document.body.dataset.ready && document.getElementById('strip')", timeout=60_000
    )
    assert page.page.url.endswith(pages[1][0])
    page.page.go_back()
    page.page.wait_for_function("document.body.dataset.ready", timeout=60_000)
    links = page("[...document.querySelectorAll('#points a')].map(a => a.getAttribute('href'))")
    assert links == [f"points/{row['point']}/report.html" for row in rows]
    assert all((sweep / link).is_file() for link in links)


def test_defaults_are_marked_and_warnings_are_there(zone: Path) -> None:
    """Fails when a value that nobody typed looks typed, or a warning of check is missing from the page."""
    page = run_page(zone, budget=0)
    assert page.about == "averaged model, 1 s"
    origins = {one.key: one.origin for _, rows in page.inputs for one in rows}
    assert origins["geometry.inlet.tma.mass_fractions.TMA"] == "typed"
    assert (origins["geometry.periodic"], origins["motion.startup"]) == ("base", "default")
    assert all(one.meaning for _, rows in page.inputs for one in rows)
    html = report(zone).read_text()
    assert '<td class="origin default">default</td>' in html
    strip = drawing(load_run(zone).case)
    assert (strip.periodic, strip.direction) == (True, 1)
    assert all(sentence.replace("'", "&#39;") in html for sentence in page.warnings)


def test_the_sheet_adds_up(cycle: Path) -> None:
    """Fails when the shares of a species that comes and goes do not sum to what came."""
    accounts = run_page(cycle, budget=0).accounts
    assert {account.species for account in accounts} >= {"TMA", "H2O"}
    for account in accounts:
        terms = {row.name.split(".")[-1]: row.value for row in account.rows}
        came = terms["fed"] + terms["produced"]
        assert came == pytest.approx(terms["reacted"] + terms["left"] + terms["stored"], rel=1e-9)


def test_curves_name_their_units_and_have_points(zone: Path) -> None:
    """Fails when a curve has no points, or an axis with a dimension no unit."""
    found = {one["title"]: one for one in curves(load_run(zone))}
    assert "Coverage that each inlet makes" in found and "Gas rising through the faces of the layers" in found
    for one in found.values():
        assert all(len(trace["x"]) > 1 for trace in one["data"])
        titles = [one["layout"][axis]["title"]["text"] for axis in ("xaxis", "yaxis")]
        assert all("[" in t or t in ("share of the sites", "mole fraction") for t in titles)


@pytest.mark.parametrize("logarithmic", [False, True])
def test_levels_give_the_values_back(logarithmic: bool) -> None:
    """Fails when encoding loses more than half a level, or what is not there comes back as a number."""
    values = np.geomspace(1e-9, 2.0, 500).reshape(20, 25)
    values[0, 0] = np.nan
    low, high = (1e-6, 2.0) if logarithmic else (0.0, 2.0)
    level = levels(values, low, high, logarithmic)
    place = (level.astype(float) - 1.0) / (LEVELS - 1)  # as the page's script does
    back = np.where(
        level > 0, low * (high / low) ** place if logarithmic else low + place * (high - low), np.nan
    )
    there = np.isfinite(values) & ((values >= low) if logarithmic else True)
    step = np.log(high / low) / (LEVELS - 1) if logarithmic else 2.0 / (LEVELS - 1)
    error = np.abs(np.log(back / values)) if logarithmic else np.abs(back - values)
    assert error[there].max() <= 0.5 * step * (1.0 + 1e-9)
    assert np.isnan(back[~there]).all()


def test_times_that_are_alike_are_stored_once() -> None:
    """Fails when a flow that does not change is carried once for every output."""
    look = Look(
        name="pressure", label="pressure", unit="Pa", factor=1.0, logarithmic=False, colours="Viridis"
    )
    field = np.arange(12.0).reshape(3, 4)
    assert encode(look, [field, field, 2.0 * field, 2.0 * field]).frames == (0, 0, 1, 1)


def test_joined_cells_keep_the_layers() -> None:
    """Fails when joining cells would mix two layers, or drops the last edge."""
    layer = np.array([0, 0, 0, 1, 1, 2])
    assert joined_edges(np.arange(7.0), layer, 2).tolist() == [0, 2, 3, 5, 6]
    assert chosen_times(10, 4) == [0, 3, 6, 9] and chosen_times(0, 4) == []


def test_a_large_run_is_joined_and_says_so(zone: Path) -> None:
    """Fails when a page grows with its run instead of staying within its budget."""
    page = run_page(zone, budget=6_000)
    assert page.viewer is not None and page.viewer["joined"] > 1
    assert "are joined to one here" in page.note


def test_run_ends_with_its_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when `mpm run` does not write the page as its last word, or writes one that was not wanted."""
    monkeypatch.chdir(tmp_path)
    coarse = [f"--set={key}={value}" for key, value in {**COARSE, "time.end": "0.2 s"}.items()]
    assert main(["run", "single_zone", "-o", "here", *coarse]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "Report: here/report.html"
    assert "Single TMA zone" in (tmp_path / "here/report.html").read_text()
    assert main(["run", "single_zone", "-o", "there", "--no-report", *coarse]) == 0
    assert "mpm report there" in capsys.readouterr().out
    assert not (tmp_path / "there/report.html").exists()


def test_what_is_no_run_is_refused(zone: Path, tmp_path: Path) -> None:
    """Fails when a directory of another kind, or too many, give a traceback or an empty page."""
    with pytest.raises(InputError, match="the directory of a run"):
        report(tmp_path)
    with pytest.raises(InputError, match="at most 6"):
        report([zone] * 7)
    for nowhere in (zone / "case.toml" / "report.html", "", "/"):
        with pytest.raises(InputError, match="cannot be written"):
            report(zone, nowhere)


def test_a_result_writes_its_page(tmp_path: Path) -> None:
    """Fails when a result from Python has no page, or one without a directory pretends to."""
    case = load_case("single_zone", {**COARSE, "time.end": "0.1 s"})
    result = Reactor(case).run(tmp_path / "run")
    assert result.report() == tmp_path / "run" / "report.html"
    with pytest.raises(InputError, match="no directory"):
        Reactor(case).run().report()


DAMAGE: dict[str, tuple[str, bytes | None, str]] = {
    "no summary": ("summary.json", None, ""),
    "cut summary": ("summary.json", b'{"status": "do', "summary.json: not readable"),
    "no fields": ("fields/fields_000001.vtu", None, "fields_000001.vtu: No such file"),
    "cut fields": ("fields/fields_000000.vtu", b"<VTKFile", "not a whole .vtu"),
    "cut flux": ("flux.csv", b"x,velocity_y.bed\n0.1,2.0\n0.2,", "flux.csv: not a table of mpm"),
    "foreign flux": ("flux.csv", b"x,velocity_y.bed\n0.1,nan\n0.2,3\n", "flux.csv: not a table of mpm"),
    "foreign origin": ("origin.json", b"[1]", "origin.json: found a list"),
    "empty history": ("history.csv", b"", "history.csv: not a history"),
}


@pytest.mark.parametrize("which", DAMAGE)
def test_what_is_damaged_is_named_and_left_out(which: str, zone: Path, tmp_path: Path) -> None:
    """Fails when a missing or damaged file stops the page, is passed over in silence, or takes more than a line."""
    name, content, words = DAMAGE[which]
    shutil.copytree(zone, tmp_path / "run")
    file = tmp_path / "run" / name
    file.unlink()
    if content is not None:
        file.write_bytes(content)
    said: list[str] = []
    html = report(tmp_path / "run", say=said.append).read_text()
    assert len(said) == (1 if words else 0) and words in "".join(said)
    assert ("This run has not reported its numbers yet" in html) == (name == "summary.json")


def test_a_run_without_any_whole_fields_has_a_page(zone: Path, tmp_path: Path) -> None:
    """Fails when the loss of all fields costs the numbers too, or every one of them is complained of."""
    shutil.copytree(zone, tmp_path / "run")
    shutil.rmtree(tmp_path / "run" / "fields")
    said: list[str] = []
    page = run_page(tmp_path / "run", said.append)
    assert page.viewer is None and page.groups
    assert len(said) == 1 and "and 4 more of 5 stored times" in said[0]


def sweep_folder(tmp_path: Path, rows: Sequence[Sequence[object]]) -> Path:
    """The files of a sweep without runs: dose, bed speed, mean coverage at the exit, status, error of each point."""
    names = ("geometry.inlet.tma.mass_fractions.TMA", "motion.bed_velocity")
    number = "titration.tma.exit_mean"
    axes = [
        {"name": name, "keys": [name], "kind": "number", "written_unit": unit, "logarithmic": False}
        for name, unit in zip(names, ("", "cm/s"), strict=True)
    ]
    about = {
        "case": "single_zone",
        "mode": "grid",
        "axes": axes,
        "columns": [*names, number],
        "program": "",
        "text": "",
    }
    (tmp_path / "sweep.json").write_text(json.dumps(about))
    with (tmp_path / "results.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("point", *names, number, "status", "error"))
        writer.writerows((f"p{i}", *row) for i, row in enumerate(rows))
    return tmp_path


def test_rounding_is_no_result_of_a_sweep(tmp_path: Path) -> None:
    """Fails when the page of a sweep draws coverages of 1e-16, or forgets what a point without a result says."""
    rows = [
        (1e-4, 0.01, 4e-16, "done", ""),
        (2e-4, 0.01, 1e-17, "done", ""),
        (2e-4, 0.02, "", "bad_input", "diverged <b>"),
    ]
    folder = sweep_folder(tmp_path, rows)
    assert sweep_page(folder).columns == []  # twice 0, and once nothing
    page = sweep_page(sweep_folder(tmp_path, [*rows, (1e-4, 0.02, 0.5, "done", "")]))
    assert [column.values for column in page.columns] == [[0.0, 0.0, None, 0.5]]
    assert page.counts == "4 points: 3 done, 1 bad input"
    assert "bad input: diverged &lt;b&gt;" in report(folder).read_text()


def test_changed_keys_are_written_as_people_type_them() -> None:
    """Fails when the page of two runs says 0.01 m/s where the case and `mpm compare` say 1 cm/s, or a run gets the value of another."""
    runs: Any = [
        SimpleNamespace(case=load_case("single_zone", {"motion.bed_velocity": speed}))
        for speed in ("1 cm/s", "0.8 cm/s", "1 cm/s")
    ]
    (line,) = key_table(runs)
    assert (line.label, list(line.texts)) == ("motion.bed_velocity", ["1 cm/s", "0.8 cm/s", "1 cm/s"])


def test_an_axis_with_a_name_of_its_own_says_which_key_it_is(tmp_path: Path) -> None:
    """Fails when the page of a sweep says `dose` and not what that is."""
    folder = sweep_folder(tmp_path, [(1e-4, 0.01, 0.5, "done", "")])
    key = "geometry.inlet.tma.mass_fractions.TMA"
    for file in ("sweep.json", "results.csv"):
        text = (folder / file).read_text()
        (folder / file).write_text(
            text.replace(key, "dose").replace('"keys": ["dose"]', f'"keys": ["{key}"]')
        )
    axis = sweep_page(folder).axes[0]
    assert axis.name == "dose" and list(axis.keys) == [key] and "mass fraction" in axis.meaning
    assert f"<td>dose</td><td><code>{key}</code></td>" in report(folder).read_text()


def test_a_sweep_of_one_point_shows_its_numbers(tmp_path: Path) -> None:
    """Fails when nothing is shown because nothing varies."""
    page = sweep_page(sweep_folder(tmp_path, [(1e-4, 0.01, 0.5, "done", "")]))
    assert page.counts == "1 point: 1 done" and [column.values for column in page.columns] == [[0.5]]


def test_amounts_of_a_steady_sweep_are_rates(tmp_path: Path) -> None:
    """Fails when what is fed per second in steady states is shown on the page of a sweep as an amount."""
    folder = sweep_folder(tmp_path, [(1e-4, 0.01, 0.5, "done", "")])
    for file in ("sweep.json", "results.csv"):
        text = (folder / file).read_text()
        (folder / file).write_text(text.replace("titration.tma.exit_mean", "species.TMA.fed"))
    assert [column.unit for column in sweep_page(folder).columns] == ["umol/m"]
    run = Layout(folder).run("p0")
    run.mkdir(parents=True)
    (run / "summary.json").write_text(json.dumps({"fidelity": "steady"}))
    assert [column.unit for column in sweep_page(folder).columns] == ["umol/m/s"]


def test_a_run_without_a_field_does_not_widen_the_range_of_the_others(zone: Path, tmp_path: Path) -> None:
    """Fails when a run that is fed nothing stretches the colour range to 1, or its zero is taken for a missing field."""
    changes = {**COARSE, **SHORT, "geometry.inlet.tma.mass_fractions.TMA": 0.0}
    Reactor(load_case("single_zone", changes)).run(tmp_path / "none")
    page = compare_page([zone, tmp_path / "none"])
    ranges = [
        {f["name"]: (f["low"], f["high"]) for f in film["fields"] if f["name"] != "streams"}
        for film in page.films
    ]
    run = load_run(zone)
    largest = max(run.field(run.snapshot(i), "x_TMA").max() for i in range(len(run.times)))
    assert ranges[0]["x_TMA"] == ranges[1]["x_TMA"] == pytest.approx((largest * 10.0**-DECADES, largest))


def test_rounding_is_no_amount_of_a_species() -> None:
    """Fails when a species of 1e-34 mol/m beside a feed of 1e-7 is printed with digits, or a share of such CVD."""
    fed = {"fed": 1e-7, "produced": 0.0, "reacted": 0.0, "left": 0.0, "stored": 1e-7, "balance_error": 0.0}
    trace = {
        "fed": 0.0,
        "produced": 3e-34,
        "reacted": 0.0,
        "left": 0.0,
        "stored": 3e-34,
        "balance_error": 0.0,
    }
    cvd = {"rate_mean": 1e-40, "share_in_zone": {"zone1": 0.9}}
    summary = {"species": {"TMA": fed, "Al(OH)3": trace}, "cvd": cvd}
    assert [row.shown for row in accounts(summary)[1].rows] == ["0"] * 5
    assert set(accounts(summary)[1].shares) == {""}
    assert [row.shown for _, rows in groups(summary) for row in rows] == ["0", "0"]


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (1e-17, "0 %"), (1e-6, "less than 0.001 %"), (0.12345, "12.3 %"), (0.99996, "99.996 %"), (1.0 - 1e-7, "almost 100 %"),
        (1.0, "100 %"), (1.2, "120 %"),
    ],
)  # fmt: skip
def test_what_is_nearly_all_or_nothing_is_not_rounded(share: float, words: str) -> None:
    """Fails when a trace is called none, or a coating that lacks a little complete."""
    assert percent(share) == words


def test_the_verdict_counts_inlets_together(cycle: Path) -> None:
    """Fails when four zones of one precursor take four sentences, a trace is printed with digits, or nothing coated goes unsaid."""
    case = load_run(cycle).case
    twice = {"tma": {"exit_mean": 0.5, "exit_min": 0.25}, "water": {"exit_mean": 1e-9}}
    ended = {"titration": twice, "status": "done", "simulated_seconds": 2.0}
    said = verdict(case, ended)
    assert "zone of tma with 50 % of its sites turned into OAl(CH3)2 (worst row 25 %); " in said
    said_of_use = verdict(case, {**ended, "utilisation": {"tma": 0.625}})
    assert "(worst row 25 %), where 62.5 % of the TMA fed was used; " in said_of_use
    assert "zone of water with less than 0.001 % of its sites turned into OH; " in said
    changes = {f"geometry.inlet.purge{i}.mass_fractions.TMA": 1e-3 for i in (1, 2)}
    both = {"purge1": twice["tma"], "purge2": {"exit_mean": 0.75, "exit_min": 0.5}}
    said = verdict(load_case("single_cycle", changes), {"titration": both, "status": "done"})
    assert "the zones of purge1, purge2 with 50 % to 75 % of its sites" in said and "(worst row 25 %)" in said
    undosed = load_case(
        "single_cycle", {f"geometry.inlet.{name}.mass_fractions": {} for name in ("tma", "water")}
    )
    assert "nothing has been coated: no inlet doses a surface" in verdict(undosed, {"status": "done"})
    assert "no coverage has been reported" in verdict(case, {"status": "failed"})


def test_long_names_have_room_beside_the_strip() -> None:
    """Fails when a long name of a layer is cut, or names of zones are written over each other."""
    short = drawing(load_case("single_cycle"))
    assert short.right < 250.0 and short.hidden_zones == []
    long = replace(short, zones=[("a_zone_with_a_long_name", 0.0, 30.0), ("b", 30.0, 860.0)])
    assert long.hidden_zones == ["a_zone_with_a_long_name", "b"]
    band = replace(short.bands[0], text="x" * 60)
    assert replace(short, bands=[band]).right > 60 * LETTER


NARROW = 400
"""Width of a telephone."""


@pytest.mark.browser
def test_pages_fit_a_narrow_window(zone: Path, weaker: Path, cycle: Path, browser: Any) -> None:
    """Fails when something sticks out of a narrow window instead of scrolling by itself."""
    for where in (cycle, [zone, weaker]):
        page = Page(browser, report(where))
        page.page.set_viewport_size({"width": NARROW, "height": 800})
        page.page.wait_for_timeout(200)
        assert page("document.documentElement.scrollWidth") == NARROW


@pytest.mark.parametrize(
    ("low", "high", "shown"),
    [
        (1.0, 1.00001, (0.0, 1.00001)),
        (-2.0, -2.0, (-2.0, 0.0)),
        (0.0, 0.0, (0.0, 1.0)),
        (-1.0, 3.0, (-1.0, 3.0)),
    ],
)
def test_what_is_even_has_no_rainbow(low: float, high: float, shown: tuple[float, float]) -> None:
    """Fails when the rounding of a field that is the same everywhere gets all the colours."""
    look = Look(name="velocity", label="speed", unit="cm/s", factor=1.0, logarithmic=False, colours="Viridis")
    assert value_range(look, low, high) == shown


def test_a_page_that_finds_no_room_costs_no_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fails when a run that is done counts as failed because its page could not be written, or that goes unsaid."""

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "here/report.html")

    monkeypatch.setattr("mpm.page.write.write_atomically", full)
    tiny = [f"--set={key}={value}" for key, value in {**TINY, "time.end": "0.1 s"}.items()]
    assert main(["run", "single_zone", "-q", "-o", str(tmp_path / "run"), *tiny]) == 0
    assert capsys.readouterr().err.endswith("no report: here/report.html: No space left on device\n")


def test_nothing_beside_what_is_not_reported_is_no_difference(zone: Path, tmp_path: Path) -> None:
    """Fails when a steady and a transient run are compared by lines of dashes and zeros."""
    Reactor(load_case("single_zone", {**COARSE, "fidelity": "steady"})).run(tmp_path / "steady")
    lines = number_table([load_run(zone), load_run(tmp_path / "steady")])
    assert ("TMA fed", "umol/m") in {(line.label, line.unit) for line in lines}
    assert all(set(line.texts) - {"", "0"} for line in lines)
