# make demo | test | test-all | lint | docs | bench | accuracy | paper | mutants | newest | lowest | v4l2-test |
# genicam-test | pylon-test | bare-test; each sets up its own .venv first.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: demo test test-all lint format docs bench accuracy paper mutants newest lowest constraints v4l2-test genicam-test pylon-test bare-test clean
.DEFAULT_GOAL := demo

$(VENV)/base: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "phasedic needs Python 3.11 or newer; make PYTHON=python3.12 ... picks another")'
	@echo "Setting up $(VENV) (once; about 300 MB are fetched) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --disable-pip-version-check --constraint constraints.txt --editable .
	@touch $@

$(VENV)/test: $(VENV)/base
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[test]'
	@touch $@

$(VENV)/dev: $(VENV)/test
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[test,dev]'
	@touch $@

$(VENV)/docs: $(VENV)/base
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

demo: $(VENV)/base
	@$(BIN)/phasedic demo

# Side by side, a file a process; tests in real time then one after another, with the machine to themselves. The fast
# ones take one process more than there are processors, since some of them wait.
PARALLEL := -n auto --dist loadfile --no-loadscope-reorder
MORE     := -n $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 1)')
TIMED     = $(shell grep -rl mark.timed tests --include='test_*.py')
# Modules are compiled once for all processes of the tests, also where Python is told to keep nothing.
test test-all newest lowest: export PYTHONDONTWRITEBYTECODE =

test: $(VENV)/test
	@$(BIN)/python -m pytest $(PARALLEL) $(MORE) -m "not slow and not timed"
	@$(BIN)/python -m pytest $(TIMED) -m "timed and not slow"

# And those that take long.
test-all: test
	@$(BIN)/python -m pytest $(PARALLEL) -m "slow and not timed"
	@$(BIN)/python -m pytest $(TIMED) -m "slow and timed"

lint: $(VENV)/dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@printf '%s\n' linux win32 darwin | xargs -P 2 -I{} $(BIN)/mypy --platform {} --cache-dir .mypy_cache/{}

format: $(VENV)/dev
	@$(BIN)/ruff check --fix-only --quiet .
	@$(BIN)/ruff format --quiet .

docs: $(VENV)/docs
	@$(BIN)/python -m docs.make_site

bench: $(VENV)/test
	@$(BIN)/python -m tests.bench

accuracy: $(VENV)/test
	@$(BIN)/python -m tests.accuracy

# The paper reproduced, a quarter of an hour: tables, and a page in build. DATA=DIR has the DIC Challenge image sets.
paper: $(VENV)/test
	@mkdir -p build
	@$(BIN)/python -m tests.paper --out docs/data/characterisation --page build/characterisation.md $(if $(DATA),--data $(DATA))

mutants: $(VENV)/test
	@$(BIN)/python -m tests.mutants

# The tests with the newest libraries there are, and with the lowest that pyproject.toml names, each in its own
# environment with a cache of its own for compiled loops.
newest lowest: export NUMBA_CACHE_DIR = $(CURDIR)/$(VENV)-$@/numba
newest:
	@rm -rf $(VENV)-$@ && $(PYTHON) -m venv $(VENV)-$@
	@$(VENV)-$@/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@PATH="$(CURDIR)/$(VENV)-$@/bin:$$PATH" python -m pytest $(PARALLEL) -m "not timed"
	@PATH="$(CURDIR)/$(VENV)-$@/bin:$$PATH" python -m pytest $(TIMED) -m timed

lowest:
	@rm -rf $(VENV)-$@ && $(PYTHON) -m venv $(VENV)-$@
	@$(VENV)-$@/bin/python -m pip install --quiet --disable-pip-version-check uv
	@$(VENV)-$@/bin/uv pip install --quiet --python $(VENV)-$@/bin/python --resolution lowest-direct --editable '.[test]'
	@PATH="$(CURDIR)/$(VENV)-$@/bin:$$PATH" python -m pytest $(PARALLEL) -m "not timed"
	@PATH="$(CURDIR)/$(VENV)-$@/bin:$$PATH" python -m pytest $(TIMED) -m timed

# After make newest has passed: its versions are those of demo and test from then on.
constraints:
	@$(VENV)-newest/bin/python -m pip install --quiet --disable-pip-version-check '.[test,dev]'
	@{ head -n 2 constraints.txt; $(VENV)-newest/bin/python -m pip freeze --all --exclude pip --exclude phasedic; } > constraints.new
	@mv constraints.new constraints.txt

v4l2-test: $(VENV)/test
	@$(BIN)/python tests/v4l2/vm.py --tests

genicam-test: $(VENV)/test
	@$(BIN)/python -m tests.genicam.namespace --tests

# pypylon goes into a folder of its own, so that other tests run without it.
$(VENV)/pylon: $(VENV)/test
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade --target $@ 'pypylon>=26.9'

pylon-test: $(VENV)/pylon
	@PYTHONPATH=$(CURDIR)/$(VENV)/pylon PYLON_CAMEMU=2 $(BIN)/python -m tests.genicam.namespace --tests tests/pylon

# In a bare Debian made on the spot, or kept in ROOT: make bare-test SUITE=trixie ONLY=demo
SUITE ?= forky
ONLY  ?= demo test
bare-test:
	@$(PYTHON) tests/bare/machine.py --suite $(SUITE) $(if $(ROOT),--root $(ROOT)) -- make $(ONLY)

clean:
	rm -rf $(VENV) $(VENV)-newest $(VENV)-lowest .pytest_cache .mypy_cache .ruff_cache
