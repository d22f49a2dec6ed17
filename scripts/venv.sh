#!/usr/bin/env bash
# Make the environment of this clone: scripts/venv.sh [DIRECTORY [REQUIREMENTS]]   (default: .venv requirements.lock)
# Looks for what the system lacks first and says how to get it, then installs the locked versions and this package.
# With REQUIREMENTS empty the newest versions that pyproject.toml allows are installed (make lock does that).
set -euo pipefail
cd "$(dirname "$0")/.."
target=${1:-.venv}
requirements=${2-requirements.lock}
extras=fem,chemistry,dem,sweep,view,dev

stop() {
    printf 'make venv: %s\n' "$*" >&2
    exit 1
}

new_enough() { # a Python >= 3.12 that really starts (a pyenv shim may not)
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 12))' >/dev/null 2>&1
}

find_python() {
    local name
    for name in python3.14 python3.13 python3.12 python3 python; do
        if new_enough "$name"; then
            command -v "$name"
            return
        fi
    done
    if command -v uv >/dev/null; then
        uv python install --quiet 3.12 && uv python find 3.12 && return
    fi
    return 1
}

python=$(find_python) || stop "needs Python 3.12 or newer: install python3.12 with its venv and dev packages, or uv, and run it again"

# The wheels bring FEniCSx, PETSc and MPI. What is left to the system: a C compiler and Python's headers (FEniCSx compiles
# its forms at run time), and the libraries that the gmsh wheel loads even without a window.
"$python" - <<'PY' || exit 1
import ctypes, os, shutil, sys, sysconfig

debian = []
missing = []
if not any(shutil.which(name) for name in filter(None, [os.environ.get("CC"), "cc", "gcc", "clang"])):
    missing.append("a C compiler")
    debian.append("gcc libc6-dev")
if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")):
    missing.append("the headers of Python (Python.h)")
    debian.append(f"python3.{sys.version_info.minor}-dev")
try:
    import ensurepip, venv
except ImportError:
    missing.append("Python's venv module")
    debian.append(f"python3.{sys.version_info.minor}-venv")
if sys.platform == "linux":
    for library, package in [
        ("libGL.so.1", "libgl1"),
        ("libGLU.so.1", "libglu1-mesa"),
        ("libXrender.so.1", "libxrender1"),
        ("libXcursor.so.1", "libxcursor1"),
        ("libXft.so.2", "libxft2"),
        ("libXinerama.so.1", "libxinerama1"),
        ("libXfixes.so.3", "libxfixes3"),
        ("libgomp.so.1", "libgomp1"),
    ]:
        try:
            ctypes.CDLL(library)
        except OSError:
            missing.append(library)
            debian.append(package)
if missing:
    print(f"make venv: this system lacks {', '.join(missing)}", file=sys.stderr)
    print(f"           Debian, Ubuntu: sudo apt-get install {' '.join(debian)}", file=sys.stderr)
    sys.exit(1)
PY

if ! new_enough "$target/bin/python"; then
    echo "make venv: $("$python" --version) at $python"
    "$python" -m venv --clear "$target"
fi
pip() { "$target/bin/python" -m pip --disable-pip-version-check "$@"; }
if [ -n "$requirements" ]; then
    pip install --quiet --requirement "$requirements"
    pip install --quiet --no-deps --editable .
    pip check
else
    pip install --quiet --upgrade pip
    pip install --quiet --editable ".[$extras]"
fi
