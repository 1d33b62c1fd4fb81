"""Exit codes and messages of the command line; the pipeline itself is tested where it is."""

from __future__ import annotations

import errno
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from io import BytesIO, TextIOWrapper
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from processes import clean_environment, run_on_ranks

import bladefem.report
import bladefem.study.pipeline
from bladefem.cli.main import main, parser
from bladefem.cli.tables import response_tables
from bladefem.data import ModeSet, Patch, PressureMap
from bladefem.errors import InputError, NotSolvedError, UnwritableError
from bladefem.io.own_results import note_results
from bladefem.io.run_folder import lock_run_folder
from bladefem.scene.toml import dump_scene, load_scene
from geometry.mesh import Mesh

SCENES = Path(__file__).parents[2] / "scenes"
WEDGE = "scenes/wedge.toml"


# of each point of a curve, and of no weight for what a command prints
POINT_COLUMNS = (
    *("first", "method", "route", "residual", "iterations", "slipping", "drift", "dissipated"),
    *("imbalance", "estimated", "tolerated", "checked", "branch", "stability"),
)


def fake_curve(load, amplitude):
    return SimpleNamespace(
        load=load,
        mass=None,
        peak=SimpleNamespace(),
        friction_work=2e-3,
        slipping_at_peak=3,
        drift_at_peak=0.0,
        settings=SimpleNamespace(error=0.013, harmonics=3),
        halved=np.nan,
        body_mesh=np.nan,
        layer_law=np.nan,
        error=0.013,
        interval=None,
        lower=None,
        is_march=False,
        keeps_unstable=False,
        reaches_layer=False,
        peak_frequency=830.0,
        peak_amplitude=amplitude,
        frequency=np.arange(5.0),
        # the one that is not solved is not next to the highest
        converged=np.array([True, True, True, False, True]),
        amplitude=amplitude * np.array([0.5, 1.0, 0.5, 0.4, 0.3]),
        balance_amplitude=amplitude,
        **dict.fromkeys(POINT_COLUMNS, np.zeros(5)),
    )


def fake_limit(load, frequency):
    return SimpleNamespace(
        load=load,
        peak_frequency=frequency,
        peak_amplitude=8e-5,
        frequency=np.arange(3.0),
        error=0.002,
        halved=np.nan,
        body_mesh=0.001,
        mass=None,
    )


def fake_run(folder):
    mesh = Mesh(
        np.zeros((4, 3)),
        "tetra",
        {"blade": np.array([[0, 1, 2, 3]])},
        report={"worst Jacobian": 0.31},
    )
    modes = [
        ModeSet(np.array([812.4, 2000.0]), np.zeros((2, 4, 3)), n, np.array([1e-12, 2e-12]))
        for n in (0, 1)
    ]
    patch = Patch(
        "this",
        np.zeros((2, 3)),
        np.array([1e-5, 3e-5]),
        np.zeros((2, 3, 3)),
        np.zeros((1, 2)),
        None,
    )
    seat = PressureMap(patch, np.array([40.0, 0.0]), np.array([0.0, 1e-6]), 1e-14)
    limits = fake_limit(0.0, 812.4), fake_limit(np.inf, 850.0)
    response = SimpleNamespace(
        limits=limits,
        free_peak=(812.4, 8e-5),
        best=(),
        best_found=None,
        curves=[fake_curve(20.0, 4e-5), fake_curve(50.0, 2e-5)],
    )
    body = SimpleNamespace(omega=np.array([500.0, 1000.0]), shapes=np.zeros((6, 2)))
    reduced = SimpleNamespace(sectors=24, sector={9: body}, damper=body)
    return SimpleNamespace(
        mesh=mesh,
        modes=modes,
        contact=SimpleNamespace(maps={40.0: [seat]}, own=None),
        response=response,
        reduced=reduced,
        timings={"mesh": 1.5, "modes": 4.5},
        messages=["mesh: found"],
        folder=folder,
    )


@pytest.fixture
def pipeline(monkeypatch):
    """A pipeline that remembers its calls and does what ``behaviour`` says."""
    calls, state = [], SimpleNamespace(behaviour=fake_run)

    def run(scene, folder, until, comm=None, progress=None):
        calls.append((scene, folder, until))
        assert list(progress([1, 2], "label", total=2)) == [1, 2]
        return state.behaviour(folder)

    def report(scene, folder, comm, progress):
        return run(scene, folder, "report", comm, progress)

    def contact(scene, folder, comm, progress):
        return run(scene, folder, "contact", comm, progress)

    def modes(scene, folder, wanted, pictures, comm, progress):
        found = run(scene, folder, "modes", comm, progress)
        state.wanted, state.pictures = wanted, pictures
        return SimpleNamespace(
            run=found, campbell=None, convergence=None, answer=None, mac=np.eye(2)
        )

    replace_module(monkeypatch, bladefem.report, "modes", report_survey=modes)
    replace_module(monkeypatch, bladefem.report, "pressure", report_pressure=contact)
    replace_module(monkeypatch, bladefem.study.pipeline, "pipeline", run=run)
    replace_module(monkeypatch, bladefem.report, "run", report_run=report)
    return SimpleNamespace(calls=calls, state=state)


def replace_module(monkeypatch, package, name, **functions):
    """Put a stand-in with these functions in the place of a module, loaded or not."""
    module = SimpleNamespace(**functions)
    monkeypatch.setitem(sys.modules, f"{package.__name__}.{name}", module)
    monkeypatch.setattr(package, name, module, raising=False)


def test_check_prints_every_field_and_marks_what_was_given(capsys):
    assert main(["check", WEDGE, "--set", "aerofoil.lean=3 deg"]) == 0
    rows = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    assert "3 deg" in rows["aerofoil.lean"] and " * " in rows["aerofoil.lean"]
    assert (
        " * " not in rows["aerofoil.sweep"]
        and "largest thickness" in rows["aerofoil.thickness_tip"]
    )


def test_letters_that_a_terminal_does_not_have_are_no_error(monkeypatch):
    """The summary of a run has ± and ∞, of which Latin 1 has one."""
    written = BytesIO()
    monkeypatch.setattr(sys, "stdout", TextIOWrapper(written, encoding="latin-1"))
    assert main(["check", str(SCENES / "plane.toml"), "--set", "title=± ∞"]) == 0
    sys.stdout.flush()
    assert "± ?" in written.getvalue().decode("latin-1")


def modes_with_petsc(folder, *petsc):
    """`bladefem modes` of a coarse blade in a process of its own: PETSc keeps its options."""
    words = ["modes", str(SCENES / "plane.toml"), "--set", "mesh.scale=3", "-q", "--pictures", "0"]
    return subprocess.run(
        [sys.executable, "-m", "bladefem", *words, "-o", str(folder), "--", *petsc],
        capture_output=True,
        text=True,
        check=False,
    )


def test_petsc_options_that_nothing_asks_for_are_named(tmp_path):
    """Those of SLEPc and MUMPS, and those that PETSc reads at the end, are not."""
    known = ["-eps_ncv", "40", "-mat_mumps_icntl_14", "60", "-options_left", "no"]
    done = modes_with_petsc(tmp_path, *known, "-mat_mumpz_icntl_4", "1", "-foo")
    assert done.returncode == 0, done.stderr
    (warned,) = (line for line in done.stderr.splitlines() if "warning" in line)
    assert "nothing asked for -foo, -mat_mumpz_icntl_4, which had no effect" in warned


def test_petsc_options_that_come_too_late_are_refused(tmp_path):
    """PETSc ended in an error of its own at the end of the program."""
    done = modes_with_petsc(tmp_path, "-log_view")
    assert done.returncode == 2
    assert done.stderr.strip().endswith("in the environment: PETSC_OPTIONS=-log_view")


@pytest.mark.parametrize("command", ["check", "mesh"])
def test_umlauts_in_a_locale_of_ascii(command, tmp_path):
    """In title and file name; all commands ended in a traceback, by dolfinx's log, VTK and gmsh."""
    file = tmp_path / "Fläche.toml"
    text = (SCENES / "plane.toml").read_text(encoding="utf-8")
    file.write_text(text.replace('title = "', 'title = "Füße, ', 1), encoding="utf-8")
    ascii_only = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}
    words = [command, str(file), *(["-o", str(tmp_path / "ü")] if command == "mesh" else [])]
    done = subprocess.run(
        [sys.executable, "-m", "bladefem", *words],
        env={**os.environ, **ascii_only},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    if command == "mesh":
        assert {"named_mesh.msh", "mesh.vtu"} <= {made.name for made in (tmp_path / "ü").iterdir()}


def test_undecoded_letters_of_the_command_line(tmp_path):
    """Python hands them over as surrogates in a locale of ASCII; a scene and its file have UTF-8."""
    undecoded = "title=Füße µ".encode().decode("ascii", "surrogateescape")
    scene = load_scene(SCENES / "plane.toml", [undecoded])
    assert scene.title == "Füße µ"
    path = "/Öl/a.csv".encode().decode("ascii", "surrogateescape")
    held = replace(scene, temperature=replace(scene.temperature, file=path))
    assert '"/Öl/a.csv"' in dump_scene(held)
    with pytest.raises(InputError, match="expected letters in UTF-8"):
        load_scene(SCENES / "plane.toml", ["title=\udce4"])


def test_names_of_files_that_a_locale_lacks(tmp_path):
    """In a scene they are UTF-8; ASCII has no name for such a file."""
    file = tmp_path / "scene.toml"
    file.write_text('kind = "imported"\n[imported]\nfile = "Rad_ü.msh"\n', encoding="utf-8")
    ascii_only = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}
    done = subprocess.run(
        [sys.executable, "-m", "bladefem", "check", str(file)],
        env={**os.environ, **ascii_only},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2 and b"expected a locale with UTF-8" in done.stderr


@pytest.mark.parametrize(
    ("command", "until"),
    [
        ("mesh", "mesh"),
        ("modes", "modes"),
        ("contact", "contact"),
        ("reduce", "reduction"),
        ("response", "response"),
        ("report", "report"),
        ("run", "report"),
    ],
)
def test_commands_run_the_pipeline_as_far_as_needed(command, until, pipeline, tmp_path, capsys):
    folder = tmp_path / "run"
    assert main([command, WEDGE, "-o", str(folder), "--set", "contact.mu=0.2"]) == 0
    ((scene, where, last),) = pipeline.calls
    assert (where, last, scene.contact.mu) == (folder, until, 0.2)
    assert load_scene(folder / "scene.toml") == scene
    out = capsys.readouterr().out
    assert (
        "mesh: found" in out
        and "total" in out
        and "75" in out
        and out.endswith(f"results: {folder}\n")
    )
    assert all(word in out for word in SHOWN[command])


SHOWN = {
    "mesh": ["worst Jacobian", "0.31", "body blade, cells"],
    "modes": ["812.40", "2000.00", "2.0e-12"],
    "contact": ["40 N", "right", "4 ", "25.0", "1.0e-14"],
    "reduce": ["sector, nodal diameter 9", "159.2", "damper", "port dofs"],
    "report": ["best of these loads: 50 N"],
    "response": [
        "no damper",
        "resonance amplitude [µm]",
        "estimated error [%]",
        " 40  ",
        " 1.3  ",
        "best of these loads: 50 N, amplitude divided by 4",
    ],
    "run": ["best of these loads: 50 N"],
}


def test_options_of_modes(pipeline, tmp_path, capsys):
    assert (
        main(
            [
                "modes",
                WEDGE,
                "-o",
                str(tmp_path),
                "--campbell",
                "0, 10, ..., 30 rad/s",
                "--converge",
                "6, 4, 2 mm",
                "--compare",
                "runs/other",
                "--direct",
                "--pictures",
                "0",
            ]
        )
        == 0
    )
    wanted = pipeline.state.wanted
    assert np.allclose(wanted.speeds, [0, 10, 20, 30]) and np.allclose(
        wanted.sizes, [6e-3, 4e-3, 2e-3]
    )
    assert str(wanted.other) == "runs/other" and wanted.direct and pipeline.state.pictures == 0
    assert main(["modes", WEDGE, "-o", str(tmp_path), "--converge"]) == 0
    wanted = pipeline.state.wanted
    assert (wanted.speeds, wanted.sizes, wanted.other, wanted.direct) == (None, [], None, False)
    assert wanted.loads is None and wanted.damping is None
    assert (
        main(
            [
                "modes",
                WEDGE,
                "-o",
                str(tmp_path),
                "--forced",
                "tip=2 kPa",
                "--damping",
                "structural=0.2 %",
            ]
        )
        == 0
    )
    wanted = pipeline.state.wanted
    assert wanted.loads == [("tip", 2000.0)] and wanted.damping.structural == pytest.approx(0.002)
    assert main(["modes", WEDGE, "-o", str(tmp_path), "--damping", "ratio=1 %"]) == 2
    assert main(["modes", WEDGE, "-o", str(tmp_path), "--campbell", "quick"]) == 2
    assert main(["modes", WEDGE, "-o", str(tmp_path), "--pictures", "-1"]) == 2
    capsys.readouterr()
    assert main(["modes", WEDGE, "-o", str(tmp_path), "--converge", "8, 6, 4"]) == 2
    assert "converge = 8 m: expected 10 um to 1 m; did you mean '8 mm'?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "page"),
    [
        ("modes", "report_modes.html"),
        ("contact", "report_contact.html"),
        ("run", "report.html"),
    ],
)
def test_the_page_that_a_command_wrote_is_named(command, page, pipeline, tmp_path, capsys):
    """Not that of another command in the same folder."""

    def behaviour(folder):
        for name in ("report.html", "report_modes.html", "report_contact.html"):
            (folder / name).write_text("")
        return fake_run(folder)

    pipeline.state.behaviour = behaviour
    assert main([command, WEDGE, "-o", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert re.findall(r"^report: (.*)$", said, re.MULTILINE) == [str(tmp_path / page)]
    assert ("by the mesh: not studied" in said) == (command == "modes")


def test_tables_alone_make_no_print(pipeline, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("bladefem.report.pdf.browser_command", lambda: ["chromium"])
    assert main(["modes", WEDGE, "-o", str(tmp_path), "--pdf", "--pictures", "0"]) == 2
    assert "--pdf: with --pictures 0 there are tables only" in capsys.readouterr().err
    assert not pipeline.calls


def test_quiet_prints_no_summary(pipeline, tmp_path, capsys):
    assert main(["response", WEDGE, "-o", str(tmp_path), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_a_run_folder_stands_for_its_scene(pipeline, tmp_path):
    assert main(["response", WEDGE, "-o", str(tmp_path), "--set", "contact.mu=0.2"]) == 0
    assert main(["report", str(tmp_path)]) == 0
    assert pipeline.calls[1][0] == pipeline.calls[0][0] and pipeline.calls[1][1] == tmp_path


def test_study_runs_each_value_in_its_own_folder(pipeline, tmp_path, capsys):
    assert main(["study", WEDGE, "-o", str(tmp_path), "--vary", "damper.angle=30, 45, 30 deg"]) == 0
    assert [round(np.degrees(scene.damper.angle)) for scene, *_ in pipeline.calls] == [30, 45]
    assert len({folder for _, folder, _ in pipeline.calls}) == 2
    out = capsys.readouterr().out
    assert (
        out.startswith("\ndamper.angle = 30 deg (1 of 2)\n")
        and "damper.angle = 45 deg (2 of 2)\n" in out
    )
    assert "resonance amplitude [µm]" in out and "study.csv" in out.splitlines()[-1]
    table, loads = (pd.read_csv(tmp_path / f"{name}.csv") for name in ("study", "study_loads"))
    assert "value" not in table and "value" not in loads
    np.testing.assert_allclose(table["damper.angle [rad]"], np.radians([30, 45]))
    np.testing.assert_allclose(loads["damper.angle [rad]"], np.radians([30] * 4 + [45] * 4))
    assert (
        set(table["load [N]"]) == {50.0}
        and set(table["peak_amplitude [m]"]) == {2e-5}
        and len(loads) == 8
    )
    assert {f"study.{kind}" for kind in ("csv", "md", "tex", "png")} <= {
        p.name for p in tmp_path.iterdir()
    }
    assert "| 30 deg | 812.4 | 80 | 50 | 830 | 20 |" in (tmp_path / "study.md").read_text()


def test_a_study_runs_a_value_written_twice_once(pipeline, tmp_path):
    command = ["study", WEDGE, "-o", str(tmp_path), "--vary", "contact.mu=0.3, 0.30, 3e-1, 0.2"]
    assert main(command) == 0
    assert [scene.contact.mu for scene, *_ in pipeline.calls] == [0.3, 0.2]


def test_a_study_names_the_kind_that_has_no_blade(pipeline, tmp_path, capsys):
    """It complained of study.influences, which it sets itself."""
    folder = tmp_path / "run"
    command = ["study", "scenes/hertz.toml", "-o", str(folder), "--vary", "hertz.radius=40, 50 mm"]
    assert main(command) == 2
    assert "kind 'hertz' has no blade to vibrate" in capsys.readouterr().err
    assert not folder.exists()


def test_a_study_leaves_influences_out_unless_they_are_asked_for(pipeline, tmp_path):
    command = ["study", WEDGE, "-o", str(tmp_path), "--vary", "damper.angle=30, 45 deg"]
    assert main(command) == 0
    assert main([*command, "--set", "study.influences=true"]) == 0
    asked = [scene.study.influences for scene, *_ in pipeline.calls]
    assert asked == [False, False, True, True]


def test_a_study_that_breaks_off_leaves_what_is_done(pipeline, tmp_path):
    def behaviour(folder):
        if "45" in Path(folder).name:  # not anywhere in the path: pytest numbers its folders
            raise NotSolvedError("balance at 812 Hz: 40 steps")
        return fake_run(folder)

    pipeline.state.behaviour = behaviour
    assert main(["study", WEDGE, "-o", str(tmp_path), "--vary", "damper.angle=30, 45, 50 deg"]) == 1
    angles = pd.read_csv(tmp_path / "study.csv")["damper.angle [rad]"]
    np.testing.assert_allclose(angles, np.radians([30]))


def test_a_study_tells_logs_what_each_value_gave(pipeline, tmp_path, capsys, monkeypatch):
    command = ["study", WEDGE, "-o", str(tmp_path), "--vary", "damper.angle=30, 45 deg"]
    assert main(command) == 0
    said = capsys.readouterr().out
    lines = [line for line in said.splitlines() if line.startswith("finished: ")]
    assert [line.partition(" in ")[0] for line in lines] == [
        "finished: damper.angle = 30 deg (1 of 2)",
        "finished: damper.angle = 45 deg (2 of 2)",
    ]
    assert all("s: 20 um, ± 1.3 % (model; mesh apart), at 830 Hz under 50 N" in x for x in lines)
    assert "best damper.angle: not determined: the estimated errors do not separate" in said
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    assert main(command) == 0
    assert "finished: " not in capsys.readouterr().out


@pytest.mark.parametrize(
    "vary",
    [
        "damper.angle",
        "damper.angel=1",
        "damper.angle=30, 95 deg",
        "excitation.force=1, 0 N",
        "aerofoil.twist=10, 20",
        "mesh.size=",
        "kind=wedge sector, punch",
        "title=one, two",
    ],
)
def test_study_checks_all_values_before_the_first_run(vary, pipeline, tmp_path, capsys):
    assert main(["study", WEDGE, "-o", str(tmp_path), "--vary", vary]) == 2
    assert capsys.readouterr().err.count("\n") == 1 and pipeline.calls == []


@pytest.mark.parametrize("command", ["run", "response", "reduce"])
@pytest.mark.parametrize("override", ["operation.damping=0", "excitation.force=0 N"])
def test_a_response_needs_damping_and_a_force(command, override, pipeline, tmp_path, capsys):
    assert main([command, WEDGE, "-o", str(tmp_path / "run"), "--set", override]) == 2
    said = capsys.readouterr().err
    assert override.split("=")[0] in said and "expected above 0" in said and said.count("\n") == 1
    assert pipeline.calls == [] and not (tmp_path / "run").exists()
    assert main(["modes", WEDGE, "-o", str(tmp_path / "run"), "--set", override]) == 0


@pytest.mark.parametrize("budget", ["-3", "0", "nan", "inf"])
@pytest.mark.parametrize("what", [[WEDGE], ["--reference"]])
def test_a_chart_needs_a_time(budget, what, tmp_path, capsys):
    assert main(["chart", *what, "-o", str(tmp_path / "run"), "--budget", budget]) == 2
    assert "expected a positive, finite number of seconds" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "more", [[WEDGE], ["--set", "contact.mu=0.2"], ["--mesh"], ["--mesh", "9 mm"]]
)
def test_a_chart_of_the_built_in_blade_takes_no_scene(more, tmp_path, capsys):
    assert main(["chart", *more, "--reference", "-o", str(tmp_path / "run")]) == 2
    assert "expected either a scene or --reference" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_a_chart_needs_damping(tmp_path, capsys):
    assert main(["chart", WEDGE, "-o", str(tmp_path), "--set", "operation.damping=0"]) == 2
    assert "operation.damping = 0: expected above 0" in capsys.readouterr().err


def test_check_notes_what_is_improbable(capsys):
    assert main(["check", WEDGE, "--set", "material.blade.E=210 MPa"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("note: material.blade.E = 210 MPa: ")


def test_results_of_another_scene_are_put_away(pipeline, tmp_path, capsys):
    mesh = ["mesh", WEDGE, "-o", str(tmp_path)]
    assert main(mesh) == 0
    for name in ("report.html", "first.png"):
        (tmp_path / name).write_text("first")
    # as the command that writes them does
    note_results(tmp_path, {}, set())
    capsys.readouterr()
    assert main(mesh) == 0 and capsys.readouterr().err == ""
    assert main([*mesh, "--set", "contact.mu=0.2"]) == 0
    said = capsys.readouterr().err
    assert (
        said == f"bladefem: {tmp_path} holds results of another scene, which differs in "
        f"contact.mu: first.png, given.json, report.html are moved to {tmp_path / 'earlier'}, "
        "since tables and reports have one scene; stored stages stay, and those that do not depend "
        "on it are not computed again; another folder, -o, keeps both\n"
    )
    assert {p.name for p in (tmp_path / "earlier").iterdir()} == {
        "report.html",
        "first.png",
        "scene.toml",
        "given.json",
        ".results.json",
    }
    # the mesh is the same
    assert {"mesh.vtu", "named_mesh.msh"} <= {p.name for p in tmp_path.iterdir()}
    (tmp_path / "second.png").write_text("second")
    note_results(tmp_path, {}, set())
    assert main([*mesh, "--set", "mesh.scale=2", "--quiet"]) == 0 and capsys.readouterr().err == ""
    kept = {p.name for p in (tmp_path / "earlier").iterdir()} - {".results.json"}
    assert kept == {"second.png", "mesh.vtu", "named_mesh.msh", "scene.toml", "given.json"}


def test_one_command_at_a_time_in_a_folder(pipeline, tmp_path, capsys):
    with lock_run_folder(tmp_path):
        assert main(["mesh", WEDGE, "-o", str(tmp_path)]) == 2
        said = capsys.readouterr().err
        assert "another command works in it" in said and said.count("\n") == 1
        assert pipeline.calls == [] and not (tmp_path / "scene.toml").exists()
    assert main(["mesh", WEDGE, "-o", str(tmp_path)]) == 0


def raiser(error):
    def behaviour(_):
        raise error

    return behaviour


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (
            InputError("study.loads = 0: expected more"),
            2,
            "bladefem: study.loads = 0: expected more",
        ),
        (
            NotSolvedError("balance at 812 Hz: 40 steps"),
            1,
            "bladefem: not solved: balance at 812 Hz: 40 steps",
        ),
        (MemoryError("12 GB"), 1, "out of memory"),
        (KeyboardInterrupt(), 130, "finished stages are kept"),
        (
            ModuleNotFoundError("x", name="dolfinx.mesh"),
            2,
            "dolfinx.mesh is not installed; run ./setup.sh",
        ),
        (ZeroDivisionError("our fault"), 1, "mistake in the program"),
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), 2, "finished stages are kept"),
        (IsADirectoryError(errno.EISDIR, "Is a directory", "a.png"), 2, "a.png"),
        (BrokenPipeError(), 0, ""),
    ],
)
def test_what_goes_wrong_has_an_exit_code_and_a_sentence(
    error, code, message, pipeline, tmp_path, capsys
):
    pipeline.state.behaviour = raiser(error)
    assert main(["response", WEDGE, "-o", str(tmp_path)]) == code
    text = capsys.readouterr().err
    assert message in text
    assert code != 2 or text.count("\n") == 1


def test_a_full_disk_keeps_finished_stages(pipeline, tmp_path, capsys):
    """Bad input takes them away; hours of work are worth more than an empty folder."""

    def work(*_, **__):
        stages = tmp_path / "run" / "stages"
        stages.mkdir(parents=True)
        (stages / "mesh.npz").touch()
        raise UnwritableError("stages/modes.npz: cannot be written (No space left on device)")

    pipeline.state.behaviour = work
    assert main(["modes", WEDGE, "-o", str(tmp_path / "run")]) == 2
    assert (tmp_path / "run" / "stages" / "mesh.npz").exists()


def test_bad_input_that_the_work_finds_leaves_no_folder(pipeline, tmp_path):
    pipeline.state.behaviour = raiser(InputError("no face 'clamp'"))
    assert main(["modes", WEDGE, "-o", str(tmp_path / "run")]) == 2
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "scenes/wegde.toml"],
        ["mesh", WEDGE, "--set", "aerofoil.twits=1"],
        ["mesh", "scenes"],
        ["modes", WEDGE, "-o", "/proc/run"],
        ["modes", WEDGE, "-o", WEDGE],
        ["mesh", WEDGE, "--view", "mesh.xyz"],
        ["run", WEDGE, "--set", "contact.mu=0", "--set", "study.loads=auto"],
        ["study", WEDGE, "--vary", "contact.mu=0, 0.2", "--set", "study.loads=auto"],
        ["mesh", WEDGE, "--view", ""],
        ["look", WEDGE, "--view", ""],
        ["modes", WEDGE, "--compare", ""],
        ["modes", WEDGE, "--damping", ""],
        ["modes", WEDGE, "--campbell", ""],
        ["study", WEDGE],
    ],
)
def test_bad_input_stops_before_any_work(arguments, pipeline, capsys):
    assert main(arguments) == 2
    assert capsys.readouterr().err.count("\n") == 1 and pipeline.calls == []


@pytest.mark.parametrize(
    "arguments", [[], ["mehs", WEDGE], ["mesh"], ["check", WEDGE, "--nonsense"]]
)
def test_wrong_arguments_exit_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2 and "usage" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    ["check", "mesh", "modes", "contact", "reduce", "response", "study", "report", "run", "info"],
)
def test_help_has_an_example(command, capsys):
    with pytest.raises(SystemExit) as stop:
        parser().parse_args([command, "--help"])
    assert (
        stop.value.code == 0
        and f"bladefem {command}" in capsys.readouterr().out.split("example", 1)[1]
    )


def test_info_names_versions_and_solvers(capsys):
    assert main(["info"]) == 0
    rows = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert {"dolfinx", "PETSc", "MUMPS", "BLAS", "MPI", "gmsh", "OMP_NUM_THREADS"} <= set(rows)
    assert rows["MUMPS"].startswith("present") and "absent" not in rows["dolfinx"]


def test_no_mpi_is_bad_input(monkeypatch, capsys):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    assert main(["check", WEDGE]) == 2
    assert "mpi4py cannot be loaded" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [f"check {WEDGE}", "info"])
def test_a_reader_that_closes_the_pipe_is_no_error(arguments):
    """Also where PETSc is loaded, which would answer the signal by aborting MPI."""
    env = clean_environment()
    command = (
        f"'{sys.executable}' -m bladefem.cli.main {arguments} | head -n 1; exit ${{PIPESTATUS[0]}}"
    )
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, env=env)
    assert done.returncode == 0 and done.stderr == "" and done.stdout.count("\n") == 1


INTERRUPTED = """
import sys, time
from pathlib import Path
from types import SimpleNamespace
import bladefem.study.pipeline
def run(scene, folder, until, comm=None, progress=None):
    from bladefem.io.stage_cache import cached_stage
    cached_stage(folder, "mesh", "key", lambda: 1.5)
    cached_stage(folder, "modes", "key", lambda: print("started", flush=True) or time.sleep(60))
bladefem.study.pipeline.pipeline = SimpleNamespace(run=run)
from bladefem.cli.main import main
sys.exit(main(["modes", "scenes/wedge.toml", "-o", sys.argv[1]]))
"""


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_keeps_the_finished_stages(sent, code, tmp_path):
    old = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # shells start jobs in the background deaf to it
    job = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, tmp_path],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=clean_environment(),
    )
    signal.signal(signal.SIGINT, old)
    assert job.stdout.readline() == "started\n"
    job.send_signal(sent)
    said = job.communicate(timeout=30)[1]
    assert job.returncode == code and "finished stages are kept" in said and "Traceback" not in said
    assert said.count("\n") == 1 and ("SIGTERM" in said) == (code == 143)
    assert [p.name for p in (tmp_path / "stages").iterdir()] == ["mesh.npz"]


@pytest.mark.parametrize("raised", [KeyboardInterrupt, RuntimeError])
def test_a_signal_that_a_library_turns_into_an_error_is_still_an_interrupt(
    raised, pipeline, tmp_path, capsys
):
    def behaviour(_):
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            raise raised("error code 1386866960") from None

    pipeline.state.behaviour, before = behaviour, signal.getsignal(signal.SIGTERM)
    assert main(["response", WEDGE, "-o", str(tmp_path)]) == 143
    said = capsys.readouterr().err
    assert (
        said.startswith("bladefem: ended by SIGTERM; finished stages are kept")
        and said.count("\n") == 1
    )
    assert signal.getsignal(signal.SIGTERM) is before


class SignalledAtItsEnd:
    """The signal arrives while Python takes the object down, where exceptions are dropped."""

    def __del__(self):
        signal.raise_signal(signal.SIGTERM)


def test_a_signal_that_a_destructor_swallows_comes_again(pipeline, tmp_path, capsys):
    def behaviour(_):
        SignalledAtItsEnd()
        time.sleep(5)

    pipeline.state.behaviour, before = behaviour, sys.unraisablehook
    assert main(["response", WEDGE, "-o", str(tmp_path)]) == 143
    assert capsys.readouterr().err.startswith("bladefem: ended by SIGTERM")
    assert sys.unraisablehook is before


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("", "a folder without scene.toml, expected a scene file or the folder of an earlier run"),
        ("sector.step", "expected a scene file (TOML), not a mesh or a drawing; 'bladefem look"),
        ("kindless.toml", "kind is missing, expected kind = one of 'wedge sector'"),
    ],
)
def test_what_is_no_scene_is_named(given, message, tmp_path, capsys):
    (tmp_path / "kindless.toml").write_text("title = 'no kind'\n")
    assert main(["check", str(tmp_path / given)]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1


ONE_RANK_FAILS = """
import sys
import time
from pathlib import Path
from types import SimpleNamespace
import bladefem.cli.ranks as ranks
from bladefem.errors import InputError
ranks.WAIT_FOR_RANKS_SECONDS = 1.0
def action(comm):
    if {all} or comm.rank == 1:
        raise InputError("field = 1: expected 2")
    comm.Barrier()
sys.exit(ranks.exit_code_of(action, SimpleNamespace()))
"""


@pytest.mark.parametrize(
    ("all_ranks", "message"),
    [
        (True, "bladefem: field = 1: expected 2\n"),
        (False, "bladefem: rank 1 alone: field = 1: expected 2\n"),
    ],
)
def test_no_rank_waits_for_ever(all_ranks, message):
    program = ONE_RANK_FAILS.format(all=all_ranks)
    done = run_on_ranks(
        2,
        [sys.executable, "-c", program],
        timeout=60,
    )
    assert done.returncode == 2 and done.stderr.count(message) == 1, done.stderr


def test_a_scene_is_read_by_one_rank_and_solved_by_two(tmp_path):
    """Fresh processes: what rank 0 does alone must load nothing that needs all ranks."""
    command = [
        *(
            sys.executable,
            "-m",
            "bladefem.cli.main",
            "contact",
            str(SCENES / "plane.toml"),
            "-o",
            str(tmp_path),
        ),
        *("--set", "mesh.scale=4", "--set", "study.loads=20 N"),
    ]
    done = run_on_ranks(
        2,
        command,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "pressure.csv").is_file()


@pytest.mark.mpi
@pytest.mark.parametrize("arguments", [["check", WEDGE], ["mesh", WEDGE]])
def test_all_ranks_stop_on_a_scene_that_is_wrong(arguments, capsys):
    from mpi4py import MPI

    assert main([*arguments, "--set", "contact.mu=-1"]) == 2
    said = capsys.readouterr().err
    assert ("contact.mu" in said) == (MPI.COMM_WORLD.rank == 0)


@pytest.mark.mpi
def test_all_ranks_stop_where_another_command_works(tmp_path, capsys):
    from mpi4py import MPI

    with lock_run_folder(tmp_path):
        assert main(["mesh", WEDGE, "-o", str(tmp_path)]) == 2
    assert ("another command" in capsys.readouterr().err) == (MPI.COMM_WORLD.rank == 0)


def test_the_best_load_of_the_table_is_that_of_the_search(tmp_path):
    """The lowest amplitude may stand under another load, within the errors."""
    response = fake_run(tmp_path).response
    response.best_found, response.best_curve = object(), 0
    last = response_tables(response).splitlines()[-1]
    assert last == (
        "best load, by search: 20 N, amplitude divided by 2; 50 N has the lowest of these "
        "amplitudes"
    )
    response.best_curve = 1
    assert response_tables(response).endswith("best load, by search: 50 N, amplitude divided by 4")


def test_no_best_load_is_named_where_the_report_names_none(tmp_path):
    response = fake_run(tmp_path).response
    # next to the highest of the best load
    response.curves[1].converged[2] = False
    assert response_tables(response).splitlines()[-1] == (
        "best load: not determined: a point next to its highest one was not solved, so that the "
        "resonance may be higher; 50 N has the lowest of these amplitudes"
    )


OWN_BLADE = "scenes/own_blade.toml"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("imported.seats=face_11, face_14", "exchange the two names"),
        ("imported.seats=face_14, face_23", "'face_23' is not one plane face"),
        ("imported.seats=face_14, face_99", "no face 'face_99'"),
        ("damper.length=70 mm", "expected at most 60 mm"),
        ("imported.seat_width=20 mm", "the width of the narrower platform face"),
        ("support.clamp=nose", "support.clamp = 'nose': the file has no face"),
        ("imported.sectors=30", "imported.sectors = 30"),
    ],
)
def test_check_refuses_what_a_drawing_does_not_have(change, said, capsys):
    assert main(["check", OWN_BLADE, "--set", change]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ([], "engine order 9 excites nodal diameter 9 of 36 blades, at 2550 rpm with 382.5 Hz"),
        (["excitation.engine_order=40"], "engine order 40 excites nodal diameter 4 of 36 blades"),
        (["excitation.engine_order=27"], "nodal diameter 9 of 36 blades, at 2550 rpm with 1147.5 "),
        (
            ["excitation.engine_order=72", "operation.speed=0 rpm", "study.own_load=false"],
            "nodal diameter 0 of 36 blades\n",
        ),
    ],
)
def test_check_says_which_wave_is_excited(changes, said, capsys):
    overrides = [word for change in changes for word in ("--set", change)]
    assert main(["check", WEDGE, *overrides]) == 0
    assert "excitation: engine order" in (text := capsys.readouterr().out) and said in text


def test_check_notes_what_responses_of_a_file_need(capsys):
    assert main(["check", OWN_BLADE]) == 0
    assert "note:" not in capsys.readouterr().out
    assert main(["check", OWN_BLADE, "--set", "excitation.at=tpi"]) == 0
    assert "note: excitation.at = 'tpi': enough for modes" in capsys.readouterr().out


def test_an_empty_scene_name_is_not_this_folder(capsys):
    assert main(["check", ""]) == 2
    assert "scene '': expected the name" in capsys.readouterr().err
