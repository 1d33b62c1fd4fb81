"""The set-up tells what failed with its exit code, and does nothing when everything is there.

Python, pip, apt and dpkg are stand-ins here, so that every branch runs in milliseconds on any
system.
"""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOOLS = [
    "sh",
    "cat",
    "cksum",
    "mktemp",
    "dirname",
    "rm",
    "mv",
    "cp",
    "mkdir",
    "tail",
    "env",
    "flock",
]

PYTHON = """#!/bin/sh
case "$*" in
  "-c import dolfinx") exit ${DOLFINX_CODE:-0} ;;
  "-c import importlib"*) echo "numpy==${NUMPY:-1.24.2}" ;;
  "-m venv"*) mkdir -p "$4/bin" && cp "$0" "$4/bin/python" ; echo venv >> "$STEPS" ;;
  "-m pip"*) echo "pip $*" >> "$STEPS" ; echo "pip speaks" ; exit ${PIP_CODE:-0} ;;
  "-") cat > /dev/null ; exit ${IMPORT_CODE:-0} ;;
esac
"""


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@pytest.fixture
def place(tmp_path):
    """A copy of the set-up with a stand-in conda environment and only the plain tools on its
    path.
    """
    for name in ("setup.sh", "pyproject.toml", "constraints"):
        source = ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    script(tmp_path / "conda" / "bin" / "python", PYTHON)
    (tmp_path / "tools").mkdir()
    for tool in TOOLS:
        (tmp_path / "tools" / tool).symlink_to(shutil.which(tool))
    return tmp_path


def set_up(place: Path, **more: str) -> subprocess.CompletedProcess:
    env = {
        "PATH": str(place / "tools"),
        "CONDA_PREFIX": str(place / "conda"),
        "STEPS": str(place / "log"),
        "HOME": "/",
        **more,
    }
    return subprocess.run([place / "setup.sh"], capture_output=True, text=True, env=env)


def steps(place: Path) -> list[str]:
    log = place / "log"
    words = [line.split()[0] for line in log.read_text().splitlines()] if log.exists() else []
    log.unlink(missing_ok=True)
    return words


def test_second_call_does_nothing(place):
    first = set_up(place)
    assert first.returncode == 0, first.stderr
    assert steps(place) == ["venv", "pip"]
    second = set_up(place)
    assert (second.returncode, second.stdout, second.stderr, steps(place)) == (0, "", "", [])


def test_pip_keeps_what_the_system_gave(place):
    set_up(place)
    arguments = (place / "log").read_text()
    assert (
        "-c .venv/system.txt" in arguments
        and "-c constraints/" in arguments
        and "-e .[run,test]" in arguments
    )
    assert (place / ".venv" / "system.txt").read_text() == "numpy==1.24.2\n"


def test_changed_requirements_are_installed_without_a_new_environment(place):
    set_up(place)
    steps(place)
    with (place / "constraints" / "default.txt").open("a") as file:
        file.write("tqdm\n")
    assert set_up(place).returncode == 0 and steps(place) == ["pip"]


def test_a_new_numpy_of_the_system_makes_a_new_environment(place):
    """The stamp holds the system's versions of dolfinx and numpy: here dpkg speaks of another
    one.
    """
    dpkg = '#!/bin/sh\necho "python3-numpy %s install ok installed"\n'
    script(place / "tools" / "dpkg-query", dpkg % "1.24.2")
    set_up(place)
    steps(place)
    assert set_up(place).returncode == 0 and steps(place) == []
    script(place / "tools" / "dpkg-query", dpkg % "2.2.4")
    assert set_up(place, NUMPY="2.2.4").returncode == 0 and steps(place) == ["venv", "pip"]


@pytest.mark.parametrize(
    ("trouble", "said"),
    [({"PIP_CODE": "9"}, "pip speaks"), ({"IMPORT_CODE": "1"}, "does not import")],
)
def test_a_failed_installation_is_told_and_tried_again(place, trouble, said):
    failed = set_up(place, **trouble)
    assert failed.returncode == 7 and said in failed.stderr
    assert set_up(place).returncode == 0


def test_a_conda_environment_without_dolfinx_is_not_enough(place):
    failed = set_up(place, DOLFINX_CODE="1")
    assert failed.returncode == 5 and "conda env create -f environment.yml" in failed.stderr


def debian(place: Path, **tools: str) -> None:
    """dpkg knows no package; further stand-ins as given."""
    script(place / "tools" / "dpkg-query", "#!/bin/sh\nexit 1\n")
    for name, text in tools.items():
        script(place / "tools" / name.replace("_", "-"), f"#!/bin/sh\n{text}\n")


def test_a_plain_user_gets_the_exact_apt_line(place):
    debian(place, id="echo 1000", sudo="exit 1")
    failed = set_up(place, CONDA_PREFIX="")
    assert failed.returncode == 3
    assert "apt-get install -y --no-install-recommends python3-dolfinx-real" in failed.stderr
    assert "libopenblas0-pthread" in failed.stderr


def test_apt_that_fails_is_told(place):
    debian(place, id="echo 0", apt_get="echo no such package; exit 100")
    failed = set_up(place, CONDA_PREFIX="")
    assert failed.returncode == 4 and "no such package" in failed.stderr


def test_two_calls_at_once_set_up_once(place):
    slow = (
        (place / "conda" / "bin" / "python")
        .read_text()
        .replace('"-m pip"*) ', '"-m pip"*) /bin/sleep 0.5 ; ')
    )
    script(place / "conda" / "bin" / "python", slow)
    env = {
        "PATH": str(place / "tools"),
        "CONDA_PREFIX": str(place / "conda"),
        "STEPS": str(place / "log"),
        "HOME": "/",
    }
    both = [
        subprocess.Popen([place / "setup.sh"], env=env, stderr=subprocess.DEVNULL) for _ in range(2)
    ]
    assert [p.wait(timeout=30) for p in both] == [0, 0]
    assert steps(place) == ["venv", "pip"]


def test_environment_file_names_what_the_project_needs():
    import tomllib

    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    wanted = {name.split(">")[0].split("=")[0] for name in extras["run"] + extras["test"]}
    text = (ROOT / "environment.yml").read_text()
    assert all(f"- {name}" in text for name in wanted - {"gmsh"}) and "- python-gmsh" in text


def test_scripts_are_executable():
    for name in ("run", "setup.sh", ".ci/run"):
        assert os.access(ROOT / name, os.X_OK), name
