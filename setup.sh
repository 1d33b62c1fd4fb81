#!/bin/sh
# Prepares .venv for bladefem: system packages with apt (as root), a venv that sees them, then pip. Safe to repeat.
# Exit codes: 3 system packages missing and no right to install them, 4 apt failed, 5 neither Debian nor conda,
# 6 the system's dolfinx does not import, 7 pip failed or the finished environment does not import.
set -eu
cd "$(dirname "$0")"
V=.venv
STAMP=$V/.bladefem-ready
say() { printf 'bladefem setup: %s\n' "$*" >&2; }
stop() { code=$1; shift; say "$*"; exit "$code"; }

PKGS="python3-dolfinx-real python3-petsc4py-real python3-slepc4py-real python3-mpi4py python3-numpy python3-scipy
 python3-venv python3-dev gcc pkg-config openmpi-bin libopenblas0-pthread libgl1 libegl1 libegl-mesa0 libgl1-mesa-dri
 libglu1-mesa libxrender1 libxcursor1 libxfixes3 libxft2 libfontconfig1 libxinerama1"

# The browser tests need Chromium, nothing else does: CI asks for it, users are spared 300 MB.
if [ "${BLADEFEM_BROWSER:-}" = 1 ]; then PKGS="$PKGS chromium fonts-dejavu-core"; fi

# What the environment was made from: these files, the system's versions, and where it stands.
system_versions() {
  if command -v dpkg-query >/dev/null 2>&1; then
    dpkg-query -W -f '${Package} ${Version} ${Status}\n' python3-dolfinx-real python3-numpy python3-petsc4py-real 2>/dev/null || :
  fi
  cat /etc/os-release 2>/dev/null || :
  printf '%s\n' "${CONDA_PREFIX:-}"
}
key() { { cat setup.sh pyproject.toml constraints/*.txt; system_versions; pwd -P; } | cksum; }
browser() { [ "${BLADEFEM_BROWSER:-}" != 1 ] || command -v chromium >/dev/null 2>&1; }
ready() { browser && [ -x "$V/bin/python" ] && [ -r "$STAMP" ] && [ "$(cat "$STAMP")" = "$(key)" ]; }
if ready; then exit 0; fi

# Two calls at once: the second waits for the first, then finds everything ready.
if command -v flock >/dev/null 2>&1; then exec 9<setup.sh; flock 9; if ready; then exit 0; fi; fi

LOG=$(mktemp "${TMPDIR:-/tmp}/bladefem-setup.XXXXXX")
trap 'rm -f "$LOG"' EXIT
show_log() { tail -20 "$LOG" >&2; }

missing_packages() {
  for p in $PKGS; do
    case $(dpkg-query -W -f '${Status}' "$p" 2>/dev/null || :) in *" installed") ;; *) printf ' %s' "$p" ;; esac
  done
}

install_system_packages() {
  if [ "$(id -u)" = 0 ]; then SUDO=; elif sudo -n true 2>/dev/null; then SUDO="sudo -n"; else
    say "these system packages are missing, and this user may not install them. Ask an administrator to run:"
    printf '  apt-get update && apt-get install -y --no-install-recommends%s\n' "$1" >&2
    exit 3
  fi
  say "installing with apt:$1"
  APT="$SUDO env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=600 -o Acquire::Retries=3 -qq"
  $APT update >"$LOG" 2>&1 || { show_log; say "apt-get update failed; trying the package lists already here"; }
  # shellcheck disable=SC2086  # the list of packages is meant to be split into words
  $APT install -y --no-install-recommends $1 >"$LOG" 2>&1 || { show_log; stop 4 "apt-get install failed"; }
}

constraints_file() {
  id=unknown; version=
  if [ -r /etc/os-release ]; then id=$(. /etc/os-release; echo "$ID"); version=$(. /etc/os-release; echo "${VERSION_ID:-sid}"); fi
  if [ -r "constraints/$id$version.txt" ]; then echo "constraints/$id$version.txt"; else echo constraints/default.txt; fi
}

export PYTHONNOUSERSITE=1
if [ -n "${CONDA_PREFIX:-}" ] && "$CONDA_PREFIX/bin/python" -c 'import dolfinx' 2>/dev/null; then
  PY=$CONDA_PREFIX/bin/python
elif command -v dpkg-query >/dev/null 2>&1; then
  PY=/usr/bin/python3
  MISS=$(missing_packages)
  if [ -n "$MISS" ]; then install_system_packages "$MISS"; fi
else
  stop 5 "neither Debian/Ubuntu (dpkg) nor an active conda environment with dolfinx." \
    "Run: conda env create -f environment.yml && conda activate bladefem"
fi
# The system's own MPI refuses to start as root unless told, and importing dolfinx starts it.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
"$PY" -c 'import dolfinx' >"$LOG" 2>&1 || { show_log; stop 6 "$PY cannot import dolfinx"; }

# What the system gave is fixed for pip: a newer numpy in the venv would break dolfinx, petsc4py and scipy.
SYSTEM=$("$PY" -c 'import importlib.metadata as m
for name in ("numpy", "mpi4py", "petsc4py", "slepc4py"): print(name + "==" + m.version(name))')
if ! [ -x "$V/bin/python" ] || [ "$(cat "$V/system.txt" 2>/dev/null || :)" != "$SYSTEM" ]; then
  say "making $V"
  rm -rf "$V"
  "$PY" -m venv --system-site-packages "$V" >"$LOG" 2>&1 || { show_log; stop 7 "the virtual environment could not be made"; }
  printf '%s\n' "$SYSTEM" >"$V/system.txt"
fi
rm -f "$STAMP"
say "installing Python packages"
"$V/bin/python" -m pip --disable-pip-version-check install -q -c "$V/system.txt" -c "$(constraints_file)" \
  -e '.[run,test]' >"$LOG" 2>&1 || { show_log; stop 7 "pip failed"; }
"$V/bin/python" - >"$LOG" 2>&1 <<'PYTHON' || { show_log; stop 7 "the finished environment does not import"; }
import sys
import bladefem, gmsh, h5netcdf, h5py, numba, numpy, pandas, pytest, pyvista, scipy, xarray  # noqa
import dolfinx, petsc4py, slepc4py  # noqa
assert not numpy.__file__.startswith(sys.prefix + "/"), "pip installed a second numpy: " + numpy.__file__
PYTHON
say "compiling kernels, once"
"$V/bin/python" -m bladefem.hbm.precompile >"$LOG" 2>&1 || { show_log; say "they will be compiled when they are used"; }
# Those that the main job does not need follow in the background; the lock is not theirs to hold.
nice -n 19 "$V/bin/python" -m bladefem.hbm.precompile later </dev/null >/dev/null 2>&1 9>&- &
key >"$STAMP.new"
mv "$STAMP.new" "$STAMP"
say "ready"
