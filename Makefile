# make demo | test | lint | docs | bench | accuracy | v4l2-test | genicam-test | bare-test ; each sets up its own .venv first.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: demo test lint format docs bench accuracy v4l2-test genicam-test bare-test clean
.DEFAULT_GOAL := demo

$(VENV)/base: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "phasedic needs Python 3.11 or newer; make PYTHON=python3.12 ... picks another")'
	@echo "Setting up $(VENV) (once; about 300 MB are fetched) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --disable-pip-version-check --editable .
	@touch $@

$(VENV)/test: $(VENV)/base
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	@touch $@

$(VENV)/dev: $(VENV)/test
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test,dev]'
	@touch $@

$(VENV)/docs: $(VENV)/base
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

demo: $(VENV)/base
	@$(BIN)/phasedic demo

test: $(VENV)/test
	@$(BIN)/python -m pytest

lint: $(VENV)/dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

format: $(VENV)/dev
	@$(BIN)/ruff check --fix-only --quiet .
	@$(BIN)/ruff format --quiet .

docs: $(VENV)/docs
	@$(BIN)/python -m docs.make_site

bench: $(VENV)/test
	@$(BIN)/python -m tests.bench

accuracy: $(VENV)/test
	@$(BIN)/python -m tests.accuracy

v4l2-test: $(VENV)/test
	@$(BIN)/python tests/v4l2/vm.py --tests

genicam-test: $(VENV)/test
	@$(BIN)/python -m tests.genicam.namespace --tests

# In a bare Debian made on the spot: make bare-test SUITE=trixie ONLY=demo
SUITE ?= forky
ONLY  ?= demo test
bare-test:
	@$(PYTHON) tests/bare/machine.py --suite $(SUITE) -- make $(ONLY)

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache
