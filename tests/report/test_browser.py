"""The report in a real browser: opened, hovered, rotated, sorted, printed, at two widths.

Chromium without a window runs a script that is added to the page, in the time that it needs: each
step waits for what it has caused, and what was found is sent to this process, which waits for that.
``setup.sh`` installs Chromium where ``BLADEFEM_BROWSER=1``, as ``.ci/run`` does.
"""

from __future__ import annotations

import base64
import http.server
import json
import os
import queue
import re
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bladefem.data import ModeSet
from bladefem.report.pdf import browser_command, print_pdf
from bladefem.report.write import Page, write_report
from bladefem.scene.tables import Scene
from bladefem.view.live_curves import live_loops, live_optimum, live_responses
from bladefem.view.live_shapes import live_motion, live_shapes
from geometry.mesh import Mesh

sys.path.insert(0, str(Path(__file__).parents[1] / "view"))
import synthetic

COMMAND = browser_command()
WANTED = os.environ.get("BLADEFEM_BROWSER") == "1"
pytestmark = pytest.mark.skipif(
    COMMAND is None and not WANTED,
    reason="no Chromium: apt install chromium, or BLADEFEM_BROWSER=1 ./run test to install it",
)

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNkYAAAAAYAAjCB0C8AAAAASUVORK5CYII="
)
# what the browser finds may take as long, on a machine that has other work
PATIENCE_SECONDS = 600
# runs after the page's own script; what it finds is sent to ADDRESS as JSON
PROBE = """
<script>
const found = {errors: []};
window.addEventListener("error", (event) => found.errors.push(event.message));
window.addEventListener("unhandledrejection", (event) => found.errors.push(String(event.reason)));
const plain = console.error;
console.error = (...words) => { found.errors.push(words.join(" ")); plain(...words); };
const pause = (time) => new Promise((done) => setTimeout(done, time));
const frame = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
async function until(holds) {
  const end = Date.now() + PATIENCE;
  while (!holds()) {
    if (Date.now() > end) throw new Error("never came: " + holds);
    await pause(20);
  }
}
// what an action draws anew
async function redrawn(place, act) {
  let done = false;
  place.once("plotly_restyle", () => { done = true; });
  act();
  await until(() => done);
}
function put(control, value) {
  control.value = value;
  control.dispatchEvent(new Event("input"));
}
async function live(figure) {
  figure.scrollIntoView();
  await until(() => figure.classList.contains("is-live") || figure.dataset.failed);
  return figure.querySelector(".live");
}
async function probe() {
  const figures = [...document.querySelectorAll("figure[data-live]")];
  found.kinds = [];
  for (const figure of figures) {
    const place = await live(figure);
    found.kinds.push({live: figure.classList.contains("is-live"),
      failed: figure.dataset.failed || "",
      traces: place ? place.data.length : 0, width: place ? place.clientWidth : 0,
      picture: getComputedStyle(figure.querySelector("img")).display});
  }
  const chart = figures[0].querySelector(".live");
  let hovered = null;
  chart.on("plotly_hover", (event) => { hovered = event.points[0]; });
  const number = chart.data.findIndex((trace) => trace.mode === "markers");
  chart.scrollIntoView();
  await frame();
  const place = chart.getBoundingClientRect();
  const {xaxis, yaxis} = chart._fullLayout;
  const x = place.left + xaxis._offset + xaxis.d2p(chart.data[number].x[3]);
  const y = place.top + yaxis._offset + yaxis.d2p(chart.data[number].y[3]);
  const layer = chart.querySelector(".nsewdrag");
  for (const type of ["mouseover", "mouseenter", "mousemove"]) {
    const at = {clientX: x, clientY: y, bubbles: true, view: window};
    layer.dispatchEvent(new MouseEvent(type, at));
  }
  await until(() => hovered && chart.querySelector(".hoverlayer").textContent);
  found.hover = hovered && [hovered.x, hovered.y, chart.querySelector(".hoverlayer").textContent];
  const shape = figures.find((figure) => figure.textContent.includes("mode mode 1"));
  if (shape) {
    const place = shape.querySelector(".live");
    const before = Array.from(place.data[0].x);
    const slider = shape.querySelector(".phase");
    await redrawn(place, () => put(slider, 90));
    found.moved = Math.max(...before.map((x, i) => Math.abs(x - place.data[0].x[i])));
    const eye = place._fullLayout.scene.camera.eye.x;
    await Plotly.relayout(place, {"scene.camera.eye.x": eye + 1});
    found.turned = place._fullLayout.scene.camera.eye.x - eye;
    found.modes = shape.querySelector("select").options.length;
  }
  const motion = figures.find((figure) => figure.textContent.includes("amplitude[µm]"));
  if (motion) {
    const place = motion.querySelector(".live");
    const choice = motion.querySelector("select");
    const slider = motion.querySelector(".phase");
    const tip = () => [place.data[0].x[1], place.data[0].y[1], place.data[0].z[1]];
    found.motion = {label: motion.querySelector("label").textContent.trim(), start: slider.value,
      at: {}, colours: []};
    for (const phase of ["0", "90", "180"]) {
      await redrawn(place, () => put(slider, phase));
      found.motion.at[phase] = tip();
    }
    found.motion.shown = motion.querySelector("output").textContent;
    for (const load of ["0", "1"]) {
      await redrawn(place, () => put(choice, load));
      found.motion.colours.push([place.data[0].cmax, Math.max(...place.data[0].intensity)]);
    }
    motion.querySelector("button").click();
    await until(() => slider.value !== "180");
    motion.querySelector("button").click();
    found.motion.played = slider.value;
  }
  const table = document.querySelector("table.sortable");
  const column = () => [...table.tBodies[0].rows].map((row) => row.cells[2].textContent);
  found.before = column();
  table.tHead.rows[0].cells[2].click();
  found.sorted = column();
  table.tHead.rows[0].cells[2].click();
  found.reversed = column();
  found.wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
}
probe().catch((error) => found.errors.push("probe: " + error)).finally(() => {
  fetch("ADDRESS", {method: "POST", mode: "no-cors", body: JSON.stringify(found)});
});
</script>
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    """A report with curves, an optimum, a shape and a table, of made-up results."""
    folder = tmp_path_factory.mktemp("page")
    picture = folder / "picture.png"
    picture.write_bytes(PIXEL)
    points = synthetic.points()
    summary = synthetic.summary().assign(error=0.01)
    names = (
        "response/forced_response",
        "response/optimum",
        "modes/first_modes",
        "response/damped_motion",
    )
    live = {
        names[0]: live_responses(points, "a <title> & $\\frac{1}{$"),
        names[1]: live_optimum(summary, 120.0),
        names[2]: tetrahedron_shapes(),
        names[3]: live_motion(TETRAHEDRON, {"80 N": motion(1e-4), "20 N": motion(3e-4)}),
    }
    tables = {"response/summary": summary, "response/points": points}
    figures = {name: picture for name in names}
    said = ["</script><script>broken", "plain"]
    return write_report(folder, Scene(title="A report"), tables, figures, said, page=Page(live))[0]


TETRAHEDRON = Mesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "tetra",
    {"blade": np.array([[0, 1, 2, 3]])},
    {},
    {},
    {},
)


def tetrahedron_shapes() -> dict:
    """Two modes of one element, the second a turning one."""
    shapes = np.zeros((2, 4, 3), complex)
    shapes[0, 1] = (1.0, 0.5, 0)
    shapes[1, 1] = (1.0, 0.8j, 0)
    modes = ModeSet(np.array([100.0, 200.0]), shapes, 1, np.zeros(2))
    return live_shapes(TETRAHEDRON, modes, ["first flap", "first edge"])


def motion(amplitude: float) -> np.ndarray:
    """(3, 4, 3) one node that moves along x, and a third of it along y in the third harmonic."""
    moved = np.zeros((3, 4, 3), complex)
    moved[0, 1, 0] = amplitude
    moved[2, 1, 1] = 1j * amplitude / 3
    return moved


def look(page: Path, width: int) -> dict:
    """What the probe finds in a window of that width."""
    assert COMMAND is not None, "BLADEFEM_BROWSER=1, but there is no Chromium"
    probed = page.with_name(f"probed_{width}.html")
    text = page.read_text(encoding="utf-8")
    with Mailbox() as mailbox:
        probe = PROBE.replace("ADDRESS", mailbox.address)
        probe = probe.replace("PATIENCE", str(1000 * PATIENCE_SECONDS // 2))
        probed.write_text(text.replace("</body>", probe + "</body>"), encoding="utf-8")
        command = [
            *(word for word in COMMAND if word != "--disable-gpu"),
            # WebGL without a graphics card
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            f"--user-data-dir={page.parent / f'profile_{width}'}",
            f"--window-size={width},900",
            # stays open until it is ended
            "--remote-debugging-port=0",
            probed.as_uri(),
        ]
        log = page.with_name(f"browser_{width}.log")
        with log.open("w") as file, subprocess.Popen(command, stdout=file, stderr=file) as browser:
            try:
                return json.loads(mailbox.wait(browser))
            except TimeoutError as error:
                raise AssertionError(f"{error}; {log.read_text()[-2000:]}") from None
            finally:
                browser.terminate()


class Mailbox:
    """A server on this machine that takes one message."""

    def __init__(self) -> None:
        self.arrived: queue.Queue[str] = queue.Queue()
        arrived = self.arrived

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                arrived.put(self.rfile.read(int(self.headers["Content-Length"])).decode())
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                """Nothing is written."""

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self.server.server_port}/"

    def __enter__(self) -> Mailbox:
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.server.shutdown()
        self.server.server_close()

    def wait(self, browser: subprocess.Popen) -> str:
        """The message, while the browser lives and patience lasts."""
        end = time.monotonic() + PATIENCE_SECONDS
        while time.monotonic() < end and browser.poll() is None:
            try:
                return self.arrived.get(timeout=1.0)
            except queue.Empty:
                continue
        ended = browser.poll() is not None
        raise TimeoutError("the browser ended" if ended else "the page found nothing")


@pytest.fixture(scope="module")
def wide(page):
    return look(page, 1280)


def test_no_error_and_all_figures_live(wide):
    assert wide["errors"] == []
    assert [kind["live"] for kind in wide["kinds"]] == [True] * 4
    assert all(kind["picture"] == "none" for kind in wide["kinds"])


def test_a_hover_shows_the_numbers_of_a_point(wide):
    frequency, amplitude, text = wide["hover"]
    free = synthetic.points().query("load == 0").sort_values("frequency")
    assert frequency == pytest.approx(free["frequency"].iloc[3], rel=1e-6)
    assert amplitude == pytest.approx(1e6 * free["amplitude"].iloc[3], rel=1e-6)
    assert "Hz" in text
    assert "µm" in text


def test_shapes_move_with_the_phase_and_turn(wide):
    """A quarter period takes a real mode from its extreme to rest: as far as it is drawn."""
    assert wide["modes"] == 2
    assert wide["turned"] == pytest.approx(1.0)
    drawn = 0.1 / np.hypot(1, 0.5)
    assert wide["moved"] == pytest.approx(drawn, rel=1e-3)


def test_a_damped_motion_follows_its_harmonics(wide):
    """Node 1 rests at (1, 0, 0). Harmonic 1 is a cosine along x, harmonic 3 a quarter period ahead
    along y: at a quarter of the period x is at rest and y, three quarters of a period on, at +1/3.
    """
    found = wide["motion"]
    assert found["label"].startswith("load")
    drawn = 0.1 / np.hypot(1, 1 / 3)
    expected = {"0": (1 + drawn, 0, 0), "90": (1, drawn / 3, 0), "180": (1 - drawn, 0, 0)}
    for phase, place in expected.items():
        assert found["at"][phase] == pytest.approx(place, abs=1e-4)
    assert found["shown"] == "180°"
    largest = 1e6 * np.hypot(1, 1 / 3)
    for (top, intensity), size in zip(found["colours"], (1e-4, 3e-4), strict=True):
        assert top == pytest.approx(size * largest)
        assert intensity == pytest.approx(size * largest, rel=1e-5)
    assert found["played"] != "180"


def test_tables_sort_both_ways(wide):
    numbers = [float(text) for text in wide["before"]]
    assert [float(text) for text in wide["sorted"]] == sorted(numbers)
    assert [float(text) for text in wide["reversed"]] == sorted(numbers, reverse=True)


def test_a_phone_sees_the_same_without_scrolling_sideways(page):
    narrow = look(page, 500)
    assert narrow["errors"] == []
    assert all(kind["live"] for kind in narrow["kinds"])
    assert narrow["wide"] <= 0


def test_print_and_pages_without_script_show_pictures(page):
    """The picture is there from the start; style sheets hide what a script draws in print."""
    text = page.read_text(encoding="utf-8")
    assert text.count("<figure") == text.count('<img src="data:image/png')
    style = text[text.index("@media print") : text.index("</style>")]
    assert "figure.is-live img { display: block; }" in style
    assert re.search(r"\.live[^{]*\{ display: none !important; \}", style)


def test_pdf_is_printed(page):
    file = print_pdf(page)
    content = file.read_bytes()
    assert content.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", content)) >= 2


def test_the_users_words_cannot_end_a_script(page):
    assert "</script><script>broken" not in page.read_text(encoding="utf-8")


def test_numbers_of_curves_are_those_of_the_table():
    points = synthetic.points()
    spec = live_responses(points)
    marks = [trace for trace in spec["data"] if trace["mode"] == "markers"]
    count = sum(len(trace["x"]) for trace in marks if "not converged" not in trace["name"])
    assert count == int(points["converged"].sum())
    assert json.loads(json.dumps(spec, allow_nan=False)) == spec


def test_own_load_and_limits_are_lines_of_the_optimum():
    spec = live_optimum(synthetic.summary(), 120.0)
    labels = [shape["label"]["text"] for shape in spec["layout"]["shapes"]]
    assert labels == ["0 (no damper)", "∞ (full stick)", "own load 120 N"]
    assert [trace["x"] for trace in _stars(spec)] == [[200.0], [200.0]]
    assert isinstance(pd.Series(spec["data"][0]["y"]).min(), float)


def _stars(spec):
    return [trace for trace in spec["data"] if trace.get("marker", {}).get("symbol") == "star"]


def test_the_star_of_the_optimum_is_where_the_search_found_it():
    """As on the picture: not at the best of the loads studied, and in the band of equal ones."""
    summary = synthetic.summary().assign(error=0.01)
    summary.loc[summary["load"] == 800.0, "error"] = np.inf
    row = {"load": 170.0, "amplitude": 3e-6, "frequency": 870.0}
    searched = pd.DataFrame([{**row, "tolerated_from": 150.0, "tolerated_to": 190.0}])
    spec = live_optimum(summary, searched=searched)
    assert [(trace["x"], trace["y"]) for trace in _stars(spec)] == [
        ([170.0], [3.0]),
        ([170.0], [870.0]),
    ]
    bands = [(s["x0"], s["x1"]) for s in spec["layout"]["shapes"] if s["type"] == "rect"]
    assert bands == [(150.0, 190.0)] * 2
    symbols = dict(zip(spec["data"][0]["x"], spec["data"][0]["marker"]["symbol"], strict=True))
    assert [load for load, symbol in symbols.items() if symbol == "circle-open"] == [800.0]
    top = 10 ** spec["layout"]["yaxis"]["range"][1]
    assert top > 1e6 * summary["peak_amplitude"].max()
    unnamed = live_optimum(summary, searched=searched, named=False)
    assert not _stars(unnamed)
    assert not [s for s in unnamed["layout"]["shapes"] if s["type"] == "rect"]


def test_loops_and_responses_share_the_colours_of_the_loads():
    points = synthetic.points()
    loads = [load for load in np.unique(points["load"]) if 0 < load < np.inf]
    loop = (np.zeros(4), np.zeros(4))
    loops = live_loops({f"{load:g} N": {"right": loop, "left": loop} for load in loads})
    colours = {t["name"]: t["line"]["color"] for t in live_responses(points)["data"] if "line" in t}
    assert {t["name"]: t["line"]["color"] for t in loops["data"]} == {
        f"{load:g} N": colours[f"{load:g} N"] for load in loads
    }


def test_broad_pictures_take_the_width_of_the_page(page, tmp_path):
    assert 'class="broad"' not in page.read_text(encoding="utf-8")
    file = tmp_path / "influences.png"
    header = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 1900, 900)
    file.write_bytes(header)
    figures = {"response/influences": file}
    written, _ = write_report(tmp_path, Scene(), {}, figures)
    assert 'class="broad"' in written.read_text(encoding="utf-8")
