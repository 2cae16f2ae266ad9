# Two commands for a fresh machine with Python >= 3.11, pip and make: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: demo test test-fast test-benchmarks lint docs clean benchmarks paper trust calibration

demo: $(VENV)/.installed
	$(BIN)/python examples/demo.py demo

# On all cores; whole files go to a worker, as their tests share scenes.
PYTEST := $(BIN)/python -m pytest -n auto --dist loadfile

# All tests of the package.
test: $(VENV)/.installed-dev
	$(PYTEST) --ignore tests/benchmarks

# Without whole runs: what to run while working.
test-fast: $(VENV)/.installed-dev
	$(PYTEST) --ignore tests/benchmarks -m "not slow"

# What benchmarks compute and write, in their quick forms.
test-benchmarks: $(VENV)/.installed-bench
	$(PYTEST) tests/benchmarks

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

# The documentation as a site, into site/; warnings are errors.
docs: $(VENV)/.installed-docs
	$(BIN)/mkdocs build --strict

# The numbers of README.md and docs/benchmarks.md; needs the Stanford data, takes a quarter of an hour.
benchmarks: $(VENV)/.installed-bench
	$(BIN)/python benchmarks/run.py --seeds 3 --out docs/data/sets.json
	$(BIN)/python benchmarks/pairs.py --seeds 3 --keypoints heat even mixed --out docs/data/pairs.json --plot docs/pairs.png
	$(BIN)/python benchmarks/keypoints.py --out docs/data/keypoints.json
	$(BIN)/python benchmarks/model.py --out docs/data/model.json
	$(BIN)/python benchmarks/pages.py

# The paper's tables and figures beside ours, into docs/paper; needs the Stanford data, takes up to
# an hour on 2 cores, and goes on where it was stopped. In two minutes and without the data:
# make paper PAPER="--quick --out paper"
paper: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.paper $(PAPER)

# What it asserts under hard conditions, held against the truth, into docs/trust.md; up to an hour
# on 2 cores, and goes on where it was stopped. A handful of runs: make trust TRUST="--quick --out trust"
trust: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.trust --compare $(TRUST)

# The confidence of pairs and scans, into src/scanweld/confidence and docs; on 2 cores a quarter of an
# hour, and goes on where it was stopped. Only to see that it works:
# make calibration CALIBRATION="--quick --out calibration"
calibration: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.calibration $(CALIBRATION)
	$(BIN)/python -m benchmarks.trust --pages

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
