"use strict";
// Tables sort by a click on their head; figures become interactive where the browser allows it.
// Without script, in print and on failure the pictures stay.

const NUMBER = /^[-+]?[\d.]+(e[-+]?\d+)?$/i;

function cellValue(row, column) {
  const text = row.cells[column].textContent.trim();
  if (text === "∞") return Infinity;
  if (text === "-∞") return -Infinity;
  return NUMBER.test(text) ? Number(text) : text;
}

function compareValues(a, b) {
  if (a === "" || b === "") return (a === "") - (b === "");
  if (typeof a === "number" && typeof b === "number") return a - b;
  return String(a).localeCompare(String(b));
}

function sortTable(table, column, head) {
  const down = head.getAttribute("aria-sort") === "ascending";
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const body = table.tBodies[0];
  const rows = [...body.rows].sort(
    (a, b) => compareValues(cellValue(a, column), cellValue(b, column)));
  if (down) rows.reverse();
  body.append(...rows);
}

for (const table of document.querySelectorAll("table.sortable")) {
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    head.tabIndex = 0;
    head.title = "sort by this column";
    head.addEventListener("click", () => sortTable(table, column, head));
    head.addEventListener("keydown", (event) => {
      if (event.key === "Enter") sortTable(table, column, head);
    });
  });
}

function unpack(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

async function loadLibrary() {
  const holder = document.getElementById("chart-library");
  if (!holder || !("DecompressionStream" in window)) return false;
  const packed = unpack(holder.textContent.trim(), Uint8Array);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.head.append(script);
  return "Plotly" in window;
}

const FONT = {family: "system-ui, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif", size: 12, color: "#1f2933"};
const CONFIG = {responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtonsToRemove: ["lasso2d", "select2d"]};

// size of a name in a legend below a chart [px]
const LEGEND_ENTRY = 140;
const LEGEND_ROW = 24;
// between two pictures of an animation [ms]
const FRAME = 40;

function makePlace(figure) {
  const place = document.createElement("div");
  place.className = "live";
  figure.insertBefore(place, figure.querySelector("figcaption"));
  return place;
}

async function showChart(figure, spec) {
  const place = makePlace(figure);
  const axis = {gridcolor: "#e3e8ec", linecolor: "#555555", zeroline: false, exponentformat: "none"};
  const layout = {font: FONT, margin: {l: 70, r: 20, t: 40, b: 55}, plot_bgcolor: "white",
    height: figure.classList.contains("lead") ? 440 : 420, ...spec.layout};
  if (place.clientWidth < 600) {
    // names below the chart, which becomes higher by their rows; bars above it
    const named = spec.data.filter((trace) => trace.showlegend !== false && layout.showlegend !== false);
    const rows = named.length > 1 ? Math.ceil(named.length * LEGEND_ENTRY / place.clientWidth) + 1 : 0;
    const title = layout.legend && layout.legend.title;
    layout.legend = {...layout.legend, orientation: "h", yref: "container", yanchor: "bottom", y: 0,
      tracegroupgap: 0, title: title && {...title, side: "top"}};
    layout.title = undefined;
    layout.margin = {l: 55, r: 8, t: 34, b: 50 + LEGEND_ROW * rows};
    layout.height += LEGEND_ROW * rows;
  }
  for (const name of Object.keys(layout).filter((key) => /^[xy]axis/.test(key))) {
    layout[name] = {...axis, ...layout[name]};
  }
  await Plotly.newPlot(place, spec.data, layout, CONFIG);
  figure.classList.add("is-live");
}

// A motion of one or more harmonics; colours show the amplitude of each node, in shares of the
// largest one or in the unit that it is given in.
function readMode(packed, count) {
  const harmonics = packed.harmonics.map((part) => ({
    order: part.order, scale: part.scale, real: unpack(part.real, Int16Array),
    imaginary: part.imaginary ? unpack(part.imaginary, Int16Array) : new Int16Array(3 * count)}));
  const size = new Float32Array(count);
  let largest = 0;
  for (let n = 0; n < count; n++) {
    let square = 0;
    for (const {scale, real, imaginary} of harmonics) {
      for (let k = 3 * n; k < 3 * n + 3; k++) square += scale ** 2 * (real[k] ** 2 + imaginary[k] ** 2);
    }
    size[n] = Math.sqrt(square);
    largest = Math.max(largest, size[n]);
  }
  const top = packed.amplitude || 1;
  for (let n = 0; n < count; n++) size[n] *= top / (largest || 1);
  return {title: packed.title, start: packed.start || 0, harmonics, size, top};
}

function deformed(points, mode, phase, factor) {
  const axes = [0, 1, 2].map((d) => Float32Array.from({length: points.length / 3}, (_, n) => points[3 * n + d]));
  for (const {order, scale, real, imaginary} of mode.harmonics) {
    const c = Math.cos(order * phase) * scale * factor;
    const s = Math.sin(order * phase) * scale * factor;
    for (let n = 0; n < points.length / 3; n++) {
      for (let d = 0; d < 3; d++) {
        const k = 3 * n + d;
        axes[d][n] += c * real[k] - s * imaginary[k];
      }
    }
  }
  return axes;
}

function makeControls(place, modes, what) {
  const bar = document.createElement("div");
  bar.className = "controls";
  bar.innerHTML = `<label>${what} <select></select></label>` +
    '<label>phase <input class="phase" type="range" min="0" max="360" step="5"> <output></output></label>' +
    '<label>exaggeration <input class="factor" type="range" min="0" max="3" step="0.1" value="1"></label>' +
    '<button type="button">play</button>';
  const choice = bar.querySelector("select");
  modes.forEach((mode, number) => choice.add(new Option(mode.title, number)));
  place.before(bar);
  const phase = bar.querySelector(".phase");
  phase.value = modes[0].start;
  return {bar, choice, phase, degrees: bar.querySelector("output"), factor: bar.querySelector(".factor"),
    play: bar.querySelector("button")};
}

async function showShape(figure, spec) {
  const place = makePlace(figure);
  const points = unpack(spec.points, Float32Array);
  const triangles = unpack(spec.triangles, Uint32Array);
  const modes = spec.modes.map((mode) => readMode(mode, points.length / 3));
  const corner = (offset) => Array.from({length: triangles.length / 3}, (_, t) => triangles[3 * t + offset]);
  const inMicrons = "amplitude" in spec.modes[0];
  const [x, y, z] = deformed(points, modes[0], modes[0].start * Math.PI / 180, 1);
  const hidden = {visible: false};
  const size = Math.hypot(...spec.eye) / 2;
  const extents = [x, y, z].map((values) => values.reduce((a, b) => Math.max(a, b), -Infinity) -
    values.reduce((a, b) => Math.min(a, b), Infinity));
  const [rx, ry, rz] = extents.map((extent) => Math.max(1.9 * extent / Math.max(...extents), 1e-3));
  const [ex, ey, ez] = spec.eye.map((value) => value / size);
  const [ux, uy, uz] = spec.up;
  const surface = {type: "mesh3d", x, y, z, i: corner(0), j: corner(1), k: corner(2),
    intensity: modes[0].size, cmin: 0, cmax: modes[0].top, colorscale: "Viridis", flatshading: true,
    hovertemplate: inMicrons ? "%{intensity:.4~g} µm<extra></extra>" : "%{intensity:.3f} of the largest<extra></extra>",
    lighting: {ambient: 0.8, diffuse: 0.5, specular: 0.05},
    colorbar: {title: {text: inMicrons ? "amplitude<br>[µm]" : "displacement over<br>its largest value"}, thickness: 12, len: 0.6}};
  const layout = {font: FONT, height: 520, margin: {l: 0, r: 0, t: 0, b: 0},
    scene: {xaxis: hidden, yaxis: hidden, zaxis: hidden, aspectmode: "manual",
      aspectratio: {x: rx, y: ry, z: rz}, dragmode: "orbit",
      camera: {eye: {x: ex, y: ey, z: ez}, up: {x: ux, y: uy, z: uz}, projection: {type: "orthographic"}}}};
  await Plotly.newPlot(place, [surface], layout, CONFIG);
  const controls = makeControls(place, modes, spec.choice);
  const update = () => {
    const mode = modes[Number(controls.choice.value)];
    const moved = deformed(points, mode, Number(controls.phase.value) * Math.PI / 180,
      Number(controls.factor.value));
    controls.degrees.textContent = `${controls.phase.value}°`;
    return Plotly.restyle(place, {x: [moved[0]], y: [moved[1]], z: [moved[2]], intensity: [mode.size],
      cmax: mode.top});
  };
  controls.degrees.textContent = `${controls.phase.value}°`;
  for (const part of [controls.choice, controls.phase, controls.factor]) {
    part.addEventListener("input", update);
  }
  let playing = false;
  const step = async () => {
    if (!playing) return;
    controls.phase.value = (Number(controls.phase.value) + 10) % 360;
    await update();
    // by the clock: the same pace on every screen
    setTimeout(step, FRAME);
  };
  controls.play.addEventListener("click", () => {
    playing = !playing;
    controls.play.textContent = playing ? "stop" : "play";
    step();
  });
  figure.classList.add("is-live");
}

async function showFigure(figure) {
  const spec = JSON.parse(document.getElementById(figure.dataset.live).textContent);
  try {
    await (spec.kind === "shape" ? showShape : showChart)(figure, spec);
  } catch (error) {
    // no WebGL, an old browser: the picture stays
    figure.querySelectorAll(".live, .controls").forEach((part) => part.remove());
    figure.dataset.failed = String(error);
  }
}

async function start() {
  const figures = [...document.querySelectorAll("figure[data-live]")];
  if (!figures.length || !(await loadLibrary())) return;
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries.filter((one) => one.isIntersecting)) {
      watcher.unobserve(entry.target);
      showFigure(entry.target);
    }
  }, {rootMargin: "600px"});
  figures.forEach((figure) => watcher.observe(figure));
}

start();
