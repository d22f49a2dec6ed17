"use strict";
// The page is readable before this runs. Here: unpack plotly, draw the curves, and let the reader look at the fields.

const LEVELS = 4095;
const data = JSON.parse(document.getElementById("data").textContent);
const CONFIG = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
const FONT = { family: "system-ui, Segoe UI, Helvetica Neue, Arial, sans-serif", size: 12, color: "#1d2530" };
const POWERS = { exponentformat: "power" }; // plotly's own is 2p for 2e-12

async function unpack(text, kind) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream(kind));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function loadPlotly() {
  const code = await unpack(document.getElementById("plotly").textContent, "deflate");
  const script = document.createElement("script");
  script.src = URL.createObjectURL(new Blob([code], { type: "text/javascript" }));
  await new Promise((done, failed) => { script.onload = done; script.onerror = failed; document.head.append(script); });
}

// One field: its levels at every stored time, as they were encoded (differences in time, low bytes before high bytes).
async function readField(field, cells) {
  const bytes = await unpack(field.data, "deflate"), half = bytes.length / 2;
  const levels = new Uint16Array(half);
  for (let i = 0; i < half; i++) levels[i] = bytes[i] | (bytes[half + i] << 8);
  for (let i = cells; i < half; i++) levels[i] += levels[i - cells];
  return levels;
}

function valueOf(field, level) {
  if (level === 0) return NaN;
  const place = (level - 1) / (LEVELS - 1);
  return field.log ? field.low * Math.pow(field.high / field.low, place) : field.low + place * (field.high - field.low);
}

// A name as plotly writes it, which takes <i> and &amp; for markup.
const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");

// A title beside a colour bar, in lines that fit its length.
const folded = (text) => plain(text).replace(/(.{18,}?) /g, "$1<br>");

class Viewer {
  constructor(element, film, others) {
    this.element = element;
    this.film = film;
    this.columns = film.x.length - 1;
    this.rows = film.y.length - 1;
    this.plots = [...element.querySelectorAll(".plot")];
    this.selects = [...element.querySelectorAll("select.field")];
    this.slider = element.querySelector(".slider");
    this.streams = element.querySelector(".streams");
    this.zoom = element.querySelector(".zoom");
    this.scale = element.querySelector(".scale");
    this.cache = new Map();
    this.queue = Promise.resolve();
    this.fields = film.fields.filter((field) => field.name !== "streams");
    this.lines = film.fields.find((field) => field.name === "streams");
    this.prepare();
  }

  prepare() {
    this.selects.forEach((select, which) => {
      for (const field of this.fields) select.add(new Option(field.unit ? `${field.label} [${field.unit}]` : field.label, field.name));
      select.selectedIndex = Math.min(which, this.fields.length - 1);
      select.onchange = () => this.draw(true);
    });
    if (this.fields.length < 2) { this.selects[1].parentElement.hidden = true; this.plots.pop().remove(); }
    this.streams.parentElement.hidden = !this.lines;
    this.streams.onchange = () => this.draw(true);
    this.scale.onchange = () => this.draw(true);
    const bottoms = [this.film.y[0], ...this.film.layers.slice(0, -1).map((layer) => layer.top)];
    this.views = [["whole strip", this.film.y[0], this.film.y[this.rows]],
      ...this.film.layers.map((layer, i) => [layer.name, bottoms[i], layer.top])];
    this.views.forEach(([name], i) => this.zoom.add(new Option(name, i)));
    this.zoom.onchange = () => this.look();
    const last = this.film.times.length - 1;
    this.slider.max = last;
    this.slider.value = last;
    this.slider.parentElement.hidden = last < 1;
    this.slider.oninput = () => this.draw(false);
    this.element.querySelector(".play").onclick = (event) => this.play(event.target);
  }

  get index() { return Number(this.slider.value); }

  async levels(field) {
    if (!this.cache.has(field.name)) {
      const cells = field.name === "streams" ? (this.rows + 1) * (this.columns + 1) : this.rows * this.columns;
      this.cache.set(field.name, await readField(field, cells));
    }
    return this.cache.get(field.name);
  }

  // Rows of values of one field at one time; on a logarithmic colour scale their logarithms.
  async values(field, index, logarithmic, rows = this.rows, columns = this.columns) {
    const levels = await this.levels(field), start = field.frames[index] * rows * columns;
    const table = new Float64Array(LEVELS + 1);
    for (let level = 0; level <= LEVELS; level++) table[level] = logarithmic ? Math.log10(valueOf(field, level)) : valueOf(field, level);
    if (field.log) table[0] = logarithmic ? Math.log10(field.low) - 1 : 0; // less than the range shows; of other fields 0 is: nothing there
    return Array.from({ length: rows }, (_, row) => {
      const line = new Array(columns);
      for (let column = 0; column < columns; column++) {
        const value = table[levels[start + row * columns + column]];
        line[column] = Number.isFinite(value) ? value : null;
      }
      return line;
    });
  }

  draw(anew) {
    this.queue = this.queue.then(() => this.drawNow(anew)).catch((error) => { console.error(error); });
    return this.queue;
  }

  async drawNow(anew) {
    const index = this.index, time = this.film.times[index];
    this.element.querySelector("output").textContent = this.film.steady ? "steady state" : `t = ${Number(time.toPrecision(5))} s`;
    for (const [which, plot] of this.plots.entries()) {
      const field = this.fields[this.selects[which].selectedIndex];
      const logarithmic = this.scale.value === "auto" ? field.log : this.scale.value === "log" && field.low > 0;
      const z = await this.values(field, index, logarithmic);
      if (!anew && plot.data && !(this.streams.checked && this.lines.frames.some((frame) => frame !== this.lines.frames[0]))) {
        const fresh = this.heatmap(field, z, logarithmic);
        await Plotly.restyle(plot, { z: [z], text: [fresh.text] }, [0]);
      } else {
        const traces = [this.heatmap(field, z, logarithmic)];
        if (this.streams.checked) traces.push(...await this.streamlines(index));
        await Plotly.react(plot, traces, this.layout(plot), CONFIG);
      }
      plot.dataset.field = field.name;
    }
    this.element.dataset.index = index;
  }

  heatmap(field, z, logarithmic) {
    const low = logarithmic ? Math.log10(field.low) : field.low, high = logarithmic ? Math.log10(field.high) : field.high;
    const short = field.label.replace(/ \(.*/, ""); // the whole of it stands in the list of fields
    const bar = { title: { text: folded(field.unit ? `${short} [${field.unit}]` : short), side: "right" }, thickness: 14, len: 1, ...POWERS };
    if (logarithmic) {
      bar.tickvals = []; bar.ticktext = [];
      for (let power = Math.ceil(low - 1e-9); power <= high; power++) { bar.tickvals.push(power); bar.ticktext.push(`1e${power}`); }
    }
    const shown = logarithmic ? z.map((line) => line.map((v) => (v === null ? "" : v < low ? `below ${Math.pow(10, low).toPrecision(1)}` : Math.pow(10, v).toPrecision(3)))) : undefined;
    return {
      type: "heatmap", x: this.film.x, y: this.film.y, z, zmin: low, zmax: high, colorscale: field.colours, colorbar: bar,
      text: shown, hovertemplate: `x %{x:.4g} mm, y %{y:.4g} mm<br><b>${logarithmic ? "%{text}" : "%{z:.4g}"} ${field.unit}</b><extra></extra>`,
    };
  }

  async streamlines(index) {
    const rows = this.rows + 1, columns = this.columns + 1;
    const z = await this.values(this.lines, index, false, rows, columns), levels = this.film.streamLevels;
    if (levels.length < 2) return [];
    return [{
      type: "contour", x: this.film.x, y: this.film.y, z, showscale: false, hoverinfo: "skip", line: { color: "rgba(255,255,255,.9)", width: 1 },
      autocontour: false, contours: { coloring: "none", start: levels[0], end: levels[levels.length - 1], size: levels[1] - levels[0] },
    }];
  }

  layout(plot) {
    const { x, y, layers, zones, ports } = this.film, line = (x0, x1, y0, y1, colour, width, dash) =>
      ({ type: "line", x0, x1, y0, y1, line: { color: colour, width, dash }, layer: "above" });
    const [, low, high] = this.views[this.zoom.selectedIndex];
    const shapes = [
      ...layers.slice(0, -1).map((layer) => line(x[0], x[this.columns], layer.top, layer.top, "#333", 0.7)),
      ...zones.map((at) => line(at, at, y[0], y[this.rows], "#333", 0.7, "dot")),
      ...ports.map((port) => { const at = port.side === "top" ? y[this.rows] : y[0]; return line(port.x0, port.x1, at, at, port.inlet ? "#d55e00" : "#000", 6); }),
    ];
    const kept = plot.layout && plot.dataset.view === this.zoom.value ? plot.layout.xaxis.range : [x[0], x[this.columns]];
    const span = plot.layout && plot.dataset.view === this.zoom.value ? plot.layout.yaxis.range : [low, high];
    plot.dataset.view = this.zoom.value;
    return {
      margin: { l: 58, r: 130, t: 12, b: 38, autoexpand: false }, font: FONT, shapes, plot_bgcolor: "#c3cad3",
      xaxis: { title: { text: "x [mm]", standoff: 4 }, range: kept, zeroline: false, showgrid: false },
      yaxis: { title: { text: "y [mm]" }, range: span, zeroline: false, showgrid: false },
    };
  }

  look() {
    const [, low, high] = this.views[this.zoom.selectedIndex];
    for (const plot of this.plots) {
      plot.dataset.view = this.zoom.value;
      Plotly.relayout(plot, { "yaxis.range": [low, high], "xaxis.range": [this.film.x[0], this.film.x[this.columns]] });
    }
  }

  play(button) {
    if (this.timer) { clearTimeout(this.timer); this.timer = null; button.textContent = "\u25B6"; return; }
    button.textContent = "\u23F8";
    if (this.index === Number(this.slider.max)) this.slider.value = -1;
    const next = async () => {
      if (!this.timer) return;
      if (this.index >= Number(this.slider.max)) { this.play(button); return; }
      this.slider.value = this.index + 1;
      await this.draw(false);
      this.timer = this.timer && setTimeout(next, 60);
    };
    this.timer = setTimeout(next, 0);
  }
}

// The place in `edges` whose cell holds `at`; -1 outside.
function cellAt(edges, at) {
  if (at < edges[0] || at > edges[edges.length - 1]) return -1;
  let low = 0, high = edges.length - 1;
  while (high - low > 1) { const middle = (low + high) >> 1; if (edges[middle] <= at) low = middle; else high = middle; }
  return low;
}

const centres = (edges) => edges.slice(1).map((edge, i) => 0.5 * (edge + edges[i]));
const nearest = (times, at) => times.reduce((best, time, i) => (Math.abs(time - at) < Math.abs(times[best] - at) ? i : best), 0);

// Several runs below each other, all of one field, then the difference of two of them.
class Comparison {
  constructor(element, { names, films }) {
    this.element = element;
    this.names = names;
    this.plots = [...element.querySelectorAll(".plot")];
    this.times = [...element.querySelectorAll(".at")];
    this.runs = films.map((film) => Object.assign(Object.create(Viewer.prototype), {
      film, rows: film.y.length - 1, columns: film.x.length - 1, cache: new Map(), fields: film.fields.filter((f) => f.name !== "streams"),
    }));
    this.queue = Promise.resolve();
    this.field = element.querySelector(".field");
    this.pair = element.querySelector(".pair");
    this.zoom = element.querySelector(".zoom");
    this.scale = element.querySelector(".scale");
    this.slider = element.querySelector(".slider");
    const named = new Map(this.runs.flatMap((run) => run.fields.map((f) => [f.name, f])));
    for (const [name, f] of named) this.field.add(new Option(f.unit ? `${f.label} [${f.unit}]` : f.label, name));
    names.slice(1).forEach((name, i) => this.pair.add(new Option(`${name} minus ${names[0]}`, i + 1)));
    const film = films[0], bottoms = [film.y[0], ...film.layers.slice(0, -1).map((layer) => layer.top)];
    this.views = [["whole strip", film.y[0], film.y[film.y.length - 1]], ...film.layers.map((layer, i) => [layer.name, bottoms[i], layer.top])];
    this.views.forEach(([name], i) => this.zoom.add(new Option(name, i)));
    this.moments = [...new Set(films.flatMap((one) => one.times))].sort((a, b) => a - b);
    this.slider.max = this.moments.length - 1;
    this.slider.value = this.moments.length - 1;
    this.slider.parentElement.hidden = this.moments.length < 2;
    this.slider.oninput = () => this.draw();
    for (const select of [this.field, this.pair, this.zoom, this.scale]) select.onchange = () => this.draw();
    element.querySelector(".play").onclick = (event) => Viewer.prototype.play.call(this, event.target);
  }

  get index() { return Number(this.slider.value); }

  draw() {
    this.queue = this.queue.then(() => this.drawNow()).catch((error) => { console.error(error); });
    return this.queue;
  }

  async drawNow() {
    const now = this.moments[this.index], shown = [];
    this.element.querySelector(".now").textContent = `t = ${Number(now.toPrecision(5))} s`;
    for (const [which, run] of this.runs.entries()) {
      const field = run.fields.find((f) => f.name === this.field.value), index = nearest(run.film.times, now);
      this.times[which].textContent = run.film.steady ? "steady state" : `t = ${Number(run.film.times[index].toPrecision(5))} s`;
      shown.push(field ? { field, values: await run.values(field, index, false) } : null);
      if (!field) { Plotly.purge(this.plots[which]); this.plots[which].textContent = "not in this run, or zero throughout"; continue; }
      const logarithmic = this.scale.value === "auto" ? field.log : this.scale.value === "log" && field.low > 0;
      const z = await run.values(field, index, logarithmic);
      await Plotly.react(this.plots[which], [run.heatmap(field, z, logarithmic)], this.layout(run, this.plots[which]), CONFIG);
    }
    await this.drawDifference(shown);
    this.element.dataset.index = this.index;
  }

  async drawDifference(shown) {
    const other = Number(this.pair.value), plot = this.plots[this.plots.length - 1], [a, b] = [shown[0], shown[other]];
    this.times[this.times.length - 1].textContent = `${this.names[other]} minus ${this.names[0]}`;
    if (!a || !b) { Plotly.purge(plot); plot.textContent = "no difference: one of the runs has no such field"; return; }
    const [first, second] = [this.runs[0], this.runs[other]];
    const columns = centres(first.film.x).map((x) => cellAt(second.film.x, x)), rows = centres(first.film.y).map((y) => cellAt(second.film.y, y));
    let largest = 0;
    const z = a.values.map((line, row) => line.map((value, column) => {
      const theirs = rows[row] < 0 || columns[column] < 0 ? null : b.values[rows[row]][columns[column]];
      if (value === null || theirs === null) return null;
      const difference = theirs - value;
      largest = Math.max(largest, Math.abs(difference));
      return difference;
    }));
    if (largest <= 1.01 * (valueOf(a.field, LEVELS) - valueOf(a.field, LEVELS - 1))) { // one level: rounding of the page
      z.forEach((line) => line.forEach((value, column) => { if (value !== null) line[column] = 0; }));
      largest = 0;
    }
    const trace = first.heatmap({ ...a.field, low: -(largest || 1), high: largest || 1, colours: "RdBu" }, z, false);
    plot.dataset.largest = largest;
    await Plotly.react(plot, [trace], this.layout(first, plot), CONFIG);
  }

  layout(run, plot) {
    return Viewer.prototype.layout.call({ film: run.film, rows: run.rows, columns: run.columns, views: this.views, zoom: this.zoom }, plot);
  }
}

// A sweep: two charts, each of one number over what was varied.
class Explorer {
  constructor(element, sweep) {
    this.sweep = sweep;
    this.plots = [...element.querySelectorAll(".plot")];
    this.numbers = [...element.querySelectorAll(".number")];
    this.across = [...element.querySelectorAll(".across")];
    this.scales = [...element.querySelectorAll(".scale")];
    const titled = (one) => (one.unit ? `${one.label} [${one.unit}]` : one.label);
    this.titled = titled;
    for (const [which, select] of this.numbers.entries()) {
      sweep.numbers.forEach((one, i) => select.add(new Option(titled(one), i)));
      const other = sweep.numbers.findIndex((one) => one.name.split(".")[0] !== sweep.numbers[0].name.split(".")[0]);
      select.selectedIndex = which && other > 0 ? other : Math.min(which, sweep.numbers.length - 1);
    }
    for (const select of this.across) sweep.axes.forEach((axis, i) => select.add(new Option(axis.label, i)));
    for (const select of [...this.numbers, ...this.across, ...this.scales]) select.onchange = () => this.draw();
    for (const plot of this.plots) {
      plot.open = (event) => { const page = event.points[0].customdata; if (typeof page === "string" && page) location.href = page; };
    }
  }

  async draw() {
    for (const which of this.plots.keys()) {
      const plot = this.plots[which], number = this.sweep.numbers[this.numbers[which].selectedIndex];
      const along = this.across.length ? this.across[which].selectedIndex : 0;
      const logarithmic = this.scales[which].value === "log";
      const map = this.sweep.grid && this.sweep.axes.length === 2;
      const traces = map ? [this.map(number, along, logarithmic)] : this.lines(number, along);
      const x = this.sweep.axes[along], y = map ? this.sweep.axes[1 - along] : null;
      // a map is a table of cells: every value has a place and its number, however far apart they are
      const kind = (one) => (map || typeof one.values[0] === "string" ? "category" : one.log ? "log" : "linear");
      const axis = (text, type) => ({ title: { text, standoff: 8 }, type, automargin: true, zeroline: false, ...POWERS });
      const across = axis(plain(this.titled(x)), kind(x));
      const up = map ? axis(plain(this.titled(y)), kind(y)) : axis(folded(this.titled(number)), logarithmic ? "log" : "linear");
      await Plotly.react(plot, traces, { margin: { l: 70, r: 20, t: 30, b: 48 }, font: FONT, xaxis: across, yaxis: up, hovermode: "closest", legend: { orientation: "h", y: 1.02, yanchor: "bottom" } }, CONFIG);
      if (!plot.dataset.listens) { plot.on("plotly_click", plot.open); plot.dataset.listens = "yes"; }
      plot.dataset.number = number.name;
    }
  }

  level(axis, index) { return plain(`${axis.label} ${axis.values[index]} ${axis.unit}`.trim()); }

  // All axes of a point and its number, for the pointer.
  words(index, number) {
    const axes = this.sweep.axes.map((axis) => this.level(axis, index));
    const value = number.values[index];
    return [`<b>${value === null ? "no result" : Number(value.toPrecision(4))} ${number.unit}</b>`, ...axes].join("<br>");
  }

  map(number, along, logarithmic) {
    const levels = this.sweep.axes.map((axis) => [...new Set(axis.values)].sort((a, b) => (typeof a === "string" ? 0 : a - b)));
    const [across, up] = [levels[along], levels[1 - along]];
    const make = (fill) => up.map(() => across.map(() => fill));
    const z = make(null), text = make(""), pages = make("");
    number.values.forEach((value, index) => {
      const column = across.indexOf(this.sweep.axes[along].values[index]), row = up.indexOf(this.sweep.axes[1 - along].values[index]);
      z[row][column] = value === null || (logarithmic && value <= 0) ? null : logarithmic ? Math.log10(value) : value;
      text[row][column] = this.words(index, number);
      pages[row][column] = this.sweep.pages[index];
    });
    return {
      type: "heatmap", x: across, y: up, z, text, customdata: pages, hovertemplate: "%{text}<extra></extra>", colorscale: "Viridis", xgap: 1, ygap: 1,
      colorbar: { title: { text: folded((logarithmic ? "log10 of " : "") + this.titled(number)), side: "right" }, thickness: 14, ...POWERS },
    };
  }

  // One line for each combination of the other axes of a grid; points alone of a sample.
  lines(number, along) {
    const { axes, grid } = this.sweep, groups = new Map();
    number.values.forEach((value, index) => {
      const name = grid ? axes.filter((_, i) => i !== along).map((axis) => this.level(axis, index)).join(", ") : "";
      if (!groups.has(name)) groups.set(name, []);
      groups.get(name).push(index);
    });
    return [...groups].map(([name, indices]) => {
      const sorted = [...indices].sort((a, b) => (typeof axes[along].values[a] === "string" ? 0 : axes[along].values[a] - axes[along].values[b]));
      return {
        type: "scatter", mode: grid || axes.length === 1 ? "lines+markers" : "markers", name, showlegend: groups.size > 1, marker: { size: 9 },
        x: sorted.map((i) => axes[along].values[i]), y: sorted.map((i) => number.values[i]), text: sorted.map((i) => this.words(i, number)),
        customdata: sorted.map((i) => this.sweep.pages[i]), hovertemplate: "%{text}<extra></extra>",
      };
    });
  }
}

function drawCharts() {
  for (const place of document.querySelectorAll(".chart")) {
    const chart = data.charts[place.dataset.chart];
    const layout = { margin: { l: 68, r: 12, t: 30, b: 42 }, font: FONT, legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" }, showlegend: true, ...chart.layout };
    Plotly.newPlot(place, chart.data.map((trace) => ({ ...trace, name: plain(trace.name) })), layout, CONFIG);
  }
}

async function start() {
  const link = document.getElementById("download"), file = document.getElementById("casefile");
  if (link && file) link.href = URL.createObjectURL(new Blob([file.textContent], { type: "text/plain" }));
  await loadPlotly();
  drawCharts();
  window.viewers = Object.entries(data.viewers || {}).map(([id, film]) => new Viewer(document.getElementById(id), film));
  if (data.comparison && data.comparison.films.length) window.viewers.push(new Comparison(document.getElementById("comparison"), data.comparison));
  if (data.sweep && data.sweep.numbers.length) window.viewers.push(new Explorer(document.getElementById("explorer"), data.sweep));
  await Promise.all(window.viewers.map((viewer) => viewer.draw(true)));
  document.body.dataset.ready = "yes";
}

start().catch((error) => { console.error(error); document.body.dataset.ready = "failed"; });
