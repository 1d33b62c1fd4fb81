"""``./run`` finds the environment, passes arguments and exit codes on, and lets no failure
through.
"""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

# Prints its arguments; the pytest pass whose words match FAIL ends with CODE.
PYTHON = """#!/bin/sh
echo "python $*"
case "$*" in *"${FAIL:-nothing}"*) exit ${CODE:-1} ;; esac
"""
MPIRUN = """#!/bin/sh
while [ "${1#-}" != "$1" ]; do case "$1" in -n) n=$2; shift 2 ;; --bind-to) shift 2 ;; *) shift ;; esac; done
echo "ranks $n"
exec "$@" "on $n"
"""
# Prints its name; the one whose name is in FAIL ends with 1.
LINTER = """#!/bin/sh
echo "linter ${0##*/} $*"
case "${0##*/}" in "${FAIL:-nothing}") exit 1 ;; esac
"""


@pytest.fixture
def place(tmp_path):
    for name in ("run", ".ci"):
        source = ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    for name, text in (
        ("setup.sh", "#!/bin/sh\nexit ${SETUP_CODE:-0}\n"),
        (".venv/bin/python", PYTHON),
        (".venv/bin/mpirun", MPIRUN),
        *((f".venv/lint/bin/{tool}", LINTER) for tool in ("ruff", "mypy", "lint-imports")),
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    # the linters count as installed
    shutil.copy(ROOT / ".ci" / "lint.txt", tmp_path / ".venv" / "lint" / "installed.txt")
    return tmp_path


def run(place: Path, *arguments: str, **more: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [place / "run", *arguments], capture_output=True, text=True, env={**os.environ, **more}
    )


def test_alone_it_runs_the_main_job(place):
    assert (
        run(place, BLADEFEM_RANKS="1").stdout
        == "python -m bladefem.cli.main run scenes/wedge.toml -o runs/wedge\n"
    )
    assert run(place, BLADEFEM_RANKS="3").stdout == (
        "ranks 3\npython -m bladefem.cli.main run scenes/wedge.toml -o runs/wedge on 3\n"
    )


def test_the_main_job_ends_with_the_code_of_its_ranks(place):
    assert run(place, BLADEFEM_RANKS="2", FAIL="run scenes", CODE="2").returncode == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["bladefem", "check", "my scene.toml"],
            "python -m bladefem.cli.main check my scene.toml\n",
        ),
        (["python", "-c", "1"], "python -c 1\n"),
        (["demos/x.py", "a"], "python demos/x.py a\n"),
        (["mpirun", "3", "demos/x.py", "a"], "ranks 3\npython demos/x.py a on 3\n"),
    ],
)
def test_arguments_are_passed_on(arguments, said, place):
    assert run(place, *arguments).stdout == said


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["nonsense"], 2), (["mpirun"], 2), (["mpirun", "x.py"], 2), (["--help"], 0)],
)
def test_wrong_words_are_refused(arguments, code, place):
    assert run(place, *arguments).returncode == code


def test_no_mpirun_is_told(place):
    (place / ".venv" / "bin" / "mpirun").unlink()
    tools = place / "tools"
    tools.mkdir()
    for tool in ("dirname", "id", "sh"):
        (tools / tool).symlink_to(shutil.which(tool))
    for arguments in (["mpirun", "2", "x.py"], ["test"]):
        done = run(place, *arguments, PATH=str(tools))
        assert done.returncode == 2 and "mpirun is not installed" in done.stderr


def test_failed_set_up_stops_everything(place):
    done = run(place, "python", SETUP_CODE="3")
    assert done.returncode == 3 and done.stdout == ""


def test_exit_codes_come_through(place):
    assert run(place, "python", "x", FAIL="x", CODE="130").returncode == 130
    assert run(place, "mpirun", "2", "x.py", FAIL="x.py", CODE="2").returncode == 2


def test_ranks_of_tests_leave_their_core_while_they_wait(place):
    """Where others have the cores, ranks that wait busily wait for each other's turns."""
    mpirun = place / ".venv" / "bin" / "mpirun"
    mpirun.write_text('#!/bin/sh\necho "idle $OMPI_MCA_mpi_yield_when_idle"\n')
    assert run(place, "test").stdout.count("idle 1\n") == 2


def test_all_tests_run_on_one_two_and_four_ranks(place):
    done = run(place, "test")
    assert done.returncode == 0
    lines = [line for line in done.stdout.splitlines() if line.startswith("python")]
    assert (
        ["on 2" in x for x in lines] == [True, False, False]
        and "on 4" in lines[1]
        and "-n 2" in lines[2]
    )
    assert all("-m mpi" in x for x in lines[:2])


@pytest.mark.parametrize("failing", ["on 2", "on 4", "-q -n 2"])
def test_a_failure_in_any_pass_fails_the_whole(failing, place):
    for command in (place / "run", "test"), ("bash", place / ".ci" / "run"):
        env = {**os.environ, "FAIL": failing, "CODE": "1"}
        done = subprocess.run(command, capture_output=True, text=True, env=env)
        assert done.returncode == 1
        assert done.stdout.count("-m pytest") == 3  # the other passes still run


def test_a_pass_without_tests_is_a_failure_unless_tests_were_selected(place):
    assert run(place, "test", FAIL="on 4", CODE="5").returncode == 1
    assert run(place, "test", "-k", "units", FAIL="on 4", CODE="5").returncode == 0


def test_all_linters_run_and_each_can_fail_the_whole(place):
    tools = ["ruff format", "ruff check", "mypy", "lint-imports"]
    done = run(place, "lint")
    assert done.returncode == 0
    said = [line for line in done.stdout.splitlines() if line.startswith("linter ")]
    assert all(line.startswith(f"linter {tool}") for line, tool in zip(said, tools, strict=True))
    for failing in ("ruff", "mypy", "lint-imports"):
        done = run(place, "lint", FAIL=failing)
        assert done.returncode == 1
        assert done.stdout.count("linter ") == 4


def test_linters_are_installed_again_when_their_versions_change(place):
    (place / ".ci" / "lint.txt").write_text("mypy==0.0\n")
    done = run(place, "lint")
    assert done.stdout.startswith("python -m venv") and done.returncode != 0


def test_ci_runs_linters_and_tests_and_fails_with_either(place):
    for failing, code in (("mypy", 1), ("make_notebooks", 1), ("on 4", 1), ("nothing", 0)):
        env = {**os.environ, "FAIL": failing, "CODE": "1"}
        done = subprocess.run(
            ["sh", place / ".ci" / "run"], capture_output=True, text=True, env=env
        )
        assert done.returncode == code
        assert done.stdout.count("linter ") == 4
        assert done.stdout.count("-m pytest") == 3
        assert "python docs/make_notebooks.py plain_matrices" in done.stdout
