#!/bin/sh
# Make or update .venv/ in the repository's folder: find a Python >= 3.12, check the C compiler, install, check the result.
# .venv/.installed says that pip went through (without it .venv/ is made anew), .venv/.ready that the result was checked as well.
set -eu
cd "$(dirname "$0")/.."

# `make wall` in one terminal and `make test` in another: the second waits for the first one's environment.
if command -v flock >/dev/null; then
    exec 9<.
    flock -n 9 || {
        echo 'fcsim: another make makes .venv/; waiting for it'
        flock 9
        [ ! -e .venv/.ready ] || exit 0
    }
fi

fail() {
    printf 'fcsim: %s\n' "$@" >&2
    exit 1
}

# What a usable interpreter must have; it really runs, because pyenv puts shims of versions that are not active on the PATH.
usable='import sys, sysconfig, pathlib
sys.version_info >= (3, 12) or sys.exit("is Python %d.%d, older than 3.12" % sys.version_info[:2])
try:
    import venv, ensurepip
except ImportError:
    sys.exit("has no venv or ensurepip (Debian: apt-get install python3-venv)")
header = pathlib.Path(sysconfig.get_path("include"), "Python.h")
header.exists() or sys.exit("has no C headers (%s; Debian: apt-get install python3-dev)" % header)'

reason() {
    if "$1" -c '' >/dev/null 2>&1; then
        "$1" -c "$usable" 2>&1 | tail -n 1
    else
        printf 'does not run'
    fi
}

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        command -v "$PYTHON" >/dev/null || fail "PYTHON=$PYTHON is not a command"
        "$PYTHON" -c "$usable" >/dev/null 2>&1 || fail "PYTHON=$PYTHON $(reason "$PYTHON")"
        python=$PYTHON
        return
    fi
    refused=
    for candidate in python3.14 python3.13 python3.12 python3 "${HOME:-}"/.pyenv/versions/*/bin/python; do
        command -v "$candidate" >/dev/null || continue
        if "$candidate" -c "$usable" >/dev/null 2>&1; then
            python=$candidate
            return
        fi
        refused="$refused
  $candidate: $(reason "$candidate")"
    done
    fail "no usable Python >= 3.12 found; install one, or name it: make PYTHON=/path/to/python3.12${refused:+
Looked at:$refused}"
}

compiler=
for candidate in ${CC:-} cc gcc clang; do
    if command -v "$candidate" >/dev/null; then
        compiler=$candidate
        break
    fi
done
[ -n "$compiler" ] || fail "no C compiler (cc, gcc or clang) found; dolfinx compiles its forms with it. Debian: apt-get install gcc libc6-dev"

if [ ! -e .venv/.installed ] || ! .venv/bin/python -c '' >/dev/null 2>&1; then
    find_python
    printf 'fcsim: making .venv/ with %s\n' "$("$python" -c 'import sys; print(sys.executable, sys.version.split()[0])')"
    rm -rf .venv
    "$python" -m venv .venv
fi
rm -f .venv/.installed .venv/.ready
.venv/bin/python -m pip install --disable-pip-version-check -q --no-compile -c constraints.txt -e '.[fem,view,optimisation,masonry,dev]'
# on all cores what pip compiles on one, in twenty seconds and more; packages may hold templates that are no Python
.venv/bin/python -W ignore -m compileall -q -j 0 .venv/lib >/dev/null 2>&1 || true
touch .venv/.installed
.venv/bin/python -m fcsim doctor --quiet
touch .venv/.ready
