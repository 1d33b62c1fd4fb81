"""A folder is taken by one command for one scene."""

from __future__ import annotations

import subprocess
import sys

import pytest

from bladefem.errors import InputError, NotSolvedError
from bladefem.io.own_results import RESULTS_FILE
from bladefem.io.run_folder import keep_given, lock_run_folder, take_folder
from bladefem.scene.tables import Scene
from bladefem.scene.toml import load_scene, vary
from bladefem.study.pipeline.stage_inputs import same_mesh

OTHER = vary(Scene(), contact__mu=0.2)


def results(folder):
    files = (p for p in folder.rglob("*") if p.is_file() and p.name != RESULTS_FILE)
    return {str(p.relative_to(folder)) for p in files}


def test_results_go_with_their_scene_and_stages_stay(tmp_path):
    assert take_folder(tmp_path, Scene()) == ""
    for name in (
        "stages/mesh.npz",
        "report.md",
        "results.nc",
        "mu=0.2/scene.toml",
        "mu=0.2/report.md",
        "own.msh",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("first")
    assert take_folder(tmp_path, Scene()) == ""
    assert "2 files moved" in take_folder(tmp_path, OTHER)
    assert results(tmp_path) == {
        "stages/mesh.npz",
        "mu=0.2/scene.toml",
        "mu=0.2/report.md",
        "own.msh",
        "scene.toml",
        "earlier/report.md",
        "earlier/results.nc",
        "earlier/scene.toml",
    }
    assert (
        load_scene(tmp_path / "scene.toml") == OTHER
        and load_scene(tmp_path / "earlier" / "scene.toml") == Scene()
    )
    assert take_folder(tmp_path, Scene()) == ""  # nothing to put away: what is there stays
    assert (tmp_path / "earlier" / "report.md").read_text() == "first"


def test_what_is_put_away_is_told_before_it_is(tmp_path):
    """Other numbers of wheels: the files of the run are named, and what keeps them."""
    take_folder(tmp_path, Scene())
    names = [f"{letter}.csv" for letter in "abcde"]
    for name in names:
        (tmp_path / name).write_text("first")
    reported = []

    def tell(sentence):
        reported.append(sentence)
        assert {name for name in names if (tmp_path / name).exists()} == set(names)

    other = vary(Scene(), mistuning__friction=0.07)
    assert "5 files moved" in take_folder(tmp_path, other, None, tell)
    (sentence,) = reported
    assert "differs in mistuning.friction: a.csv, b.csv, c.csv and 2 more" in sentence
    assert "stages stay" in sentence and "-o" in sentence
    # nothing is left to be told of
    take_folder(tmp_path, Scene(), None, tell)
    assert len(reported) == 1


def test_files_of_a_mesh_stay_while_it_is_the_same(tmp_path):
    take_folder(tmp_path, Scene())
    for name in ("mesh.vtu", "named_mesh.msh", "report.md"):
        (tmp_path / name).write_text("first")
    assert "1 file moved" in take_folder(tmp_path, OTHER, same_mesh)
    assert {"mesh.vtu", "named_mesh.msh"} < results(tmp_path)
    finer = vary(OTHER, mesh__scale=0.5)
    assert "2 files moved" in take_folder(tmp_path, finer, same_mesh)
    assert not {"mesh.vtu", "named_mesh.msh"} & results(tmp_path)


def test_a_scene_that_cannot_be_read_counts_as_another(tmp_path):
    (tmp_path / "scene.toml").write_text("kind = 'of old'\n")
    (tmp_path / "report.md").write_text("old")
    assert "1 file moved" in take_folder(tmp_path, Scene())
    assert (tmp_path / "earlier" / "scene.toml").read_text() == "kind = 'of old'\n"


HOLDER = """
import sys
from bladefem.io.own_results import RESULTS_FILE
from bladefem.io.run_folder import lock_run_folder
with lock_run_folder(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.readline()
"""


def test_another_process_is_kept_out_and_a_dead_one_is_not(tmp_path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, tmp_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert holder.stdout.readline() == b"held\n"
    with pytest.raises(InputError, match="another command works in it"), lock_run_folder(tmp_path):
        pass
    holder.kill()
    holder.communicate()
    with lock_run_folder(tmp_path):
        pass


def end_by(error, folder, scene, files):
    """A command that writes some files and ends by an error."""
    with pytest.raises(type(error)), lock_run_folder(folder):
        take_folder(folder, scene)
        keep_given(folder, ["contact.mu"])
        for name in files:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text("second")
        raise error


def test_bad_input_leaves_no_folder_behind(tmp_path):
    end_by(InputError("no face"), tmp_path / "runs" / "a", OTHER, ["stages/mesh.npz", "mesh.vtu"])
    assert list(tmp_path.iterdir()) == []


def test_a_folder_whose_state_cannot_be_read_is_refused(tmp_path):
    folder = tmp_path / ("x" * 300)
    with (
        pytest.raises(InputError, match="cannot be written .File name too long"),
        lock_run_folder(folder),
    ):
        pass


def test_bad_input_brings_back_what_was_put_away(tmp_path):
    with lock_run_folder(tmp_path):
        take_folder(tmp_path, Scene())
    for name in ("report.md", "stages/mesh.npz", "earlier/report.md", "own.msh"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("first")
    before = {name: (tmp_path / name).read_bytes() for name in results(tmp_path)}
    end_by(InputError("no face"), tmp_path, OTHER, ["report.md", "mesh.vtu"])
    assert {name: (tmp_path / name).read_bytes() for name in results(tmp_path)} == before


def test_bad_input_says_that_results_are_back(tmp_path):
    with lock_run_folder(tmp_path):
        take_folder(tmp_path, Scene())
    (tmp_path / "report.md").write_text("first")
    with (
        pytest.raises(InputError, match=r"^no face; the results that were moved are back$"),
        lock_run_folder(tmp_path),
    ):
        assert "moved to" in take_folder(tmp_path, OTHER)
        raise InputError("no face")


@pytest.mark.parametrize(
    ("error", "files"),
    [
        (InputError("no such probe"), ["stages/mesh.npz", "stages/modes.npz"]),
        (InputError("no such probe"), ["mu=0.2/stages/modes.npz"]),
        (NotSolvedError("40 steps"), []),
    ],
)
def test_long_work_stays_with_its_scene(error, files, tmp_path):
    end_by(error, tmp_path, OTHER, files)
    assert {"scene.toml", "given.json", *files} <= results(tmp_path)


def test_what_results_replace_is_gone_after_the_command(tmp_path):
    for scene, text in ((Scene(), "first"), (OTHER, "second"), (Scene(), "third")):
        with lock_run_folder(tmp_path):
            take_folder(tmp_path, scene)
            (tmp_path / "report.md").write_text(text)
    assert (tmp_path / "earlier" / "report.md").read_text() == "second"
    assert results(tmp_path / "earlier") == {"report.md", "scene.toml"}
    assert not (tmp_path / ".earlier").exists()


def command(folder, scene, **files):
    """What a command does: it takes the folder, and writes files of its own."""
    reported = []
    with lock_run_folder(folder, reported.append):
        moved = take_folder(folder, scene)
        for name, text in files.items():
            (folder / f"{name}.md").write_text(text)
    return moved, reported


def test_files_of_the_user_stay_through_any_number_of_commands(tmp_path):
    """Results of other scenes come and go; a file that bladefem did not write is never one."""
    command(tmp_path, Scene(), report="first")
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "earlier").mkdir()
    (tmp_path / "earlier" / "older.csv").write_text("mine too")
    for number, scene in enumerate((OTHER, Scene(), OTHER)):
        moved, reported = command(tmp_path, scene, report=f"run {number}")
        assert "1 file moved" in moved and reported == []
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert (tmp_path / "earlier" / "older.csv").read_text() == "mine too"
    assert (tmp_path / "earlier" / "report.md").read_text() == "run 1"


def test_a_file_of_the_user_that_is_overwritten_is_kept(tmp_path):
    """In a folder that is no run folder yet, twice, and one that was edited after it was written."""
    (tmp_path / "report.md").write_text("mine")
    _, reported = command(tmp_path, Scene(), report="first")
    assert "report.md" in reported[0] and "not_from_bladefem" in reported[0]
    assert (tmp_path / "report.md").read_text() == "first"
    (tmp_path / "report.md").write_text("first, with my remarks")
    command(tmp_path, Scene(), report="second")
    kept = tmp_path / "not_from_bladefem"
    assert (kept / "report.md").read_text() == "mine"
    assert (kept / "report_2.md").read_text() == "first, with my remarks"
    assert not (tmp_path / ".saved").exists()


def test_a_killed_command_leaves_the_files_of_the_user(tmp_path):
    (tmp_path / ".saved").mkdir()
    (tmp_path / ".saved" / "report.md").write_text("mine")
    (tmp_path / "report.md").write_text("half")
    command(tmp_path, Scene())
    assert (tmp_path / "not_from_bladefem" / "report.md").read_text() == "mine"
