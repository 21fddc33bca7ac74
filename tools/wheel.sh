#!/bin/sh
# Build the wheel and the sdist into dist/, check them, install the wheel with the extra `all` into an empty environment and try it from
# another folder. PYTHON names the Python to try with (default: that of .venv/), FCSIM_WHEEL_TRIAL a folder for the trial that is kept.
set -eu
unset PYTHONPATH  # pip takes what lies there for installed
cd "$(dirname "$0")/.."
root=$PWD
python=${PYTHON:-$root/.venv/bin/python}
trial=${FCSIM_WHEEL_TRIAL:-$(mktemp -d)}
[ -n "${FCSIM_WHEEL_TRIAL:-}" ] || trap 'rm -rf "$trial"' EXIT
mkdir -p "$trial/elsewhere"

"$python" -m venv "$trial/build"
"$trial/build/bin/python" -m pip install --disable-pip-version-check -q -c constraints.txt build twine
rm -rf build dist ./*.egg-info
"$trial/build/bin/python" -m build
"$trial/build/bin/twine" check --strict dist/*

"$python" -m venv "$trial/empty"
wheel=$(echo dist/*.whl)
"$trial/empty/bin/python" -m pip install --disable-pip-version-check -q -c constraints.txt "$root/$wheel[all]"
"$trial/empty/bin/python" -m pip check

cd "$trial/elsewhere"
PATH="$trial/empty/bin:$PATH"
fcsim --version
fcsim doctor
fcsim cases
fcsim run masonry_wall --steps 3 --quiet
fcsim new shelf
fcsim run shelf --json > shelf.json
python -c "import json; found = json.load(open('shelf.json')); assert found['status'] == 'finished' and found['steps'] == 50, found"
fcsim render results/shelf --film none --quiet
fcsim completion bash > /dev/null
COMP_LINE='fcsim run masonry_wall --set block' COMP_POINT=34 _ARGCOMPLETE=1 _ARGCOMPLETE_STDOUT_FILENAME=completed fcsim > /dev/null 2>&1 || true
grep -q blocks_are completed
printf 'fcsim: %s works in an empty environment with %s\n' "$wheel" "$(python --version)"
