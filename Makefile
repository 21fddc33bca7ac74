# `make help` lists the targets. Each makes the environment .venv/ by itself when it is absent or out of date.
.DEFAULT_GOAL := help
.PHONY: env wall test slow docs notebooks browser-test faults mutation lint benchmark wheel clean help

WALL := results/masonry_wall
READY := .venv/.ready

$(READY): pyproject.toml constraints.txt
	@tools/environment.sh

env: $(READY)  ## make the environment .venv/ (PYTHON=... names the Python >= 3.12 to use)

wall: $(READY)  ## run the masonry wall and draw its pictures, in results/masonry_wall
	.venv/bin/fcsim run cases/masonry_wall --out $(WALL) --overwrite
	.venv/bin/fcsim render $(WALL) --page
	@echo "The wall's files, pictures, film and page.html are in $(WALL)/"

# Else every process that the tests begin compiles fcsim's sources anew, and pytest rewrites each test file in both workers of every run.
test slow browser-test faults notebooks: export PYTHONDONTWRITEBYTECODE :=

test: $(READY)  ## run the tests but the slow ones (PYTEST_ARGS="..." are passed on)
	.venv/bin/python -m pytest $(PYTEST_ARGS)

slow: $(READY)  ## run the slow tests
	.venv/bin/python -m pytest -m slow $(PYTEST_ARGS)

browser-test: $(READY)  ## open a run's page in Chromium (skipped with a reason where there is none)
	.venv/bin/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[browser]'
	.venv/bin/python -m pytest -m browser tests/browser $(PYTEST_ARGS)

DOCS := .venv/.docs

$(DOCS): $(READY)
	.venv/bin/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[docs]'
	@touch $@

docs: $(DOCS)  ## build the site, offline, into docs/_build/html
	.venv/bin/python -m sphinx -W --keep-going -q -b html -c docs -d docs/_build/doctrees . docs/_build/html
	@echo "The site's first page is docs/_build/html/index.html"

notebooks: $(DOCS)  ## execute the notebooks of docs/notebooks
	.venv/bin/python -m pytest -n 0 --nbmake docs/notebooks $(PYTEST_ARGS)

FAULTS_SEED := $(shell date +%s)

FAULTS ?= 1

faults: $(READY)  ## mutated files, options, kills, full disks with a fresh seed (FAULTS_SEED=... repeats one, FAULTS=0.1 takes a tenth)
	@echo "seed $(FAULTS_SEED)"
	FCSIM_FAULTS=$(FAULTS) FCSIM_FAULTS_SEED=$(FAULTS_SEED) .venv/bin/python -m pytest tests/faults $(PYTEST_ARGS)

mutation: $(READY)  ## count how many small errors the tests see (MUTATION="cone judge --each 0" picks modules and how many of each)
	.venv/bin/python -c "import cosmic_ray" 2>/dev/null || .venv/bin/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[mutation]'
	.venv/bin/python tools/mutation.py $(MUTATION)

lint: $(READY)  ## check style, types and who imports whom
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy -n 2
	PYTHONPATH=. .venv/bin/lint-imports

benchmark: $(READY)  ## seconds a step of the wall by phase and solver
	.venv/bin/python benchmarks/wall.py

wheel: $(READY)  ## build wheel and sdist, check them, install the wheel into an empty environment and try it there (PYTHON=... with another Python)
	tools/wheel.sh

clean:  ## remove the environment and caches (results/ stays)
	rm -rf .venv build dist docs/_build docs/_gallery docs/_generated *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +

help:
	@sed -n 's/^\([a-z-]*\):.*##/  make \1:/p' Makefile
