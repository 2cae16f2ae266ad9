# Two commands for a fresh machine with Python >= 3.11, pip and make: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: demo test test-fast test-benchmarks lint docs clean benchmarks paper trust calibration speed

demo: $(VENV)/.installed
	$(BIN)/python examples/demo.py demo

# One process a core. Tests that lie together stay together, since they share their scenes.
PYTEST = $(BIN)/python -m pytest -n auto --dist worksteal --durations 10

test: $(VENV)/.installed-dev
	$(PYTEST) --ignore tests/benchmarks

# Without runs of the whole pipeline and of other processes: for every change.
test-fast: $(VENV)/.installed-dev
	$(PYTEST) --ignore tests/benchmarks -m "not slow"

# What tests the code in benchmarks/, which needs more packages.
test-benchmarks: $(VENV)/.installed-bench
	$(PYTEST) tests/benchmarks

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

# The documentation as a site, into site/; warnings are errors.
docs: $(VENV)/.installed-docs
	$(BIN)/mkdocs build --strict

# The numbers of README.md, docs/benchmarks.md, model.md and depth.md; needs the data, takes half an
# hour. Small and without the data: make benchmarks BENCHMARKS="--quick --out bench"
benchmarks: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks $(BENCHMARKS)

# The paper's tables and figures beside ours, into docs/paper; needs the Stanford data, takes up to
# an hour on 2 cores, and goes on where it was stopped. In two minutes and without the data:
# make paper PAPER="--quick --out paper"
paper: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.paper $(PAPER)

# What it asserts under hard conditions, held against the truth, into docs/trust.md; up to an hour
# on 2 cores, and goes on where it was stopped. Which seeds it may take: benchmarks/SEEDS.md. Only to
# see that it works: make trust TRUST="--quick --out trust"
trust: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.trust --compare $(TRUST)

# The confidence of pairs and scans, into src/scanweld/confidence and docs; on 2 cores a quarter of an
# hour, and goes on where it was stopped. Only to see that it works:
# make calibration CALIBRATION="--quick --out calibration"
calibration: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.calibration $(CALIBRATION)
	$(BIN)/python -m benchmarks.trust --pages

# CPU seconds of runs, beside a fixed loop and Open3D, into docs/performance.md; needs the data and a
# quiet machine, takes an hour. Only to see that it works: make speed SPEED="--quick --out speed"
speed: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.speed $(SPEED)

clean:
	rm -rf $(VENV) demo site

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

$(VENV)/.installed-bench: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev,bench]'
	touch $@

$(VENV)/.installed-docs: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@
