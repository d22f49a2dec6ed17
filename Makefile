# make demo: install, run the single-zone reactor, write its page        make test: install, run all tests
# make venv, lint, bench, lock, clean: see the comment at each target

VENV ?= .venv
BIN := $(VENV)/bin
PYTHON := $(BIN)/python
MPIRUN ?= $(BIN)/mpirun
WORKERS ?= 2
DEMO ?= results/single_zone

# `mpm`, `mpirun` and `python` in recipes, tests and case scripts are those of the environment.
export PATH := $(CURDIR)/$(BIN):$(PATH)
# One thread per rank: the ranks share the cores.
export OMP_NUM_THREADS ?= 1

.PHONY: venv demo test lint bench lock clean
.DEFAULT_GOAL := demo

# Environment with the locked versions and this package, installed once and after a change of what it is made from.
venv: $(VENV)/.installed

$(VENV)/.installed: requirements.lock pyproject.toml scripts/venv.sh
	@echo "Installing into $(VENV) (once, some minutes)"
	@scripts/venv.sh $(VENV)
	@touch $@

# A TMA zone of 139.7 mm: 20 s of a vibrating bed on 28,359 cells, its page and its pictures.
demo: venv
	mpm run cases/single_zone.toml -o $(DEMO) --overwrite
	mpm plot $(DEMO)
	@echo "Page: $(DEMO)/report.html   pictures: $(DEMO)/plots   numbers: $(DEMO)/summary.json   ParaView: $(DEMO)/fields.pvd"

# All tests serially, then those marked `parallel` on 2 and on 3 ranks. More ranks than cores should sleep while they wait
# (a setting of MPICH): else each message waits for the time slice of a rank that only polls.
test: venv
	$(PYTHON) -m pytest -n $(WORKERS) --dist worksteal
	$(MPIRUN) -n 2 $(PYTHON) -m pytest -m parallel
	MPIR_CVAR_ENABLE_HEAVY_YIELD=1 $(MPIRUN) -n 3 $(PYTHON) -m pytest -m parallel

# Style and types; no finding is allowed.
lint: venv
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# A table of speed and memory on 1 and 2 ranks. A report, not a test.
bench: venv
	$(PYTHON) scripts/bench.py

# Newest versions that pyproject.toml allows, from a fresh environment, into requirements.lock.
lock:
	scripts/venv.sh $(VENV)-lock ""
	{ echo "# Versions that CI runs with. Written by 'make lock' (pip freeze of a fresh environment); do not edit."; \
	  $(VENV)-lock/bin/python -m pip freeze --exclude-editable; } > requirements.lock
	rm -r $(VENV)-lock

clean:
	rm -rf results .pytest_cache .mypy_cache .ruff_cache build *.egg-info
