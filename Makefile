# tissuq: `make demo` shows what it does, `make test` runs the quick tests, `make test-all` runs every test. All make their own environment in .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUNS ?= runs
PROCESSES ?= 2
PYTEST := $(BIN)/python -m pytest --numprocesses $(PROCESSES) --dist worksteal
LONG := slow or statistical or finite_elements
BENCH := .venv-bench
APT := { apt-get install -qq -y calculix-ccx chromium || { apt-get update -qq && apt-get install -qq -y calculix-ccx chromium; }; }
JAX_CACHE ?= .jax_cache

unexport PYTHONDONTWRITEBYTECODE  # or each process compiles all tests, and each command that a test runs the package, anew

.PHONY: demo test test-rest test-all coverage mutants fuzz frozen architecture docs lint types check system lock bench clean help

help:  ## List the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: $(VENV)/.installed  ## Carry out the paper's study and fit measured brain tissue; say where the reports lie
	$(BIN)/tissuq paper --replicates 20 --out $(RUNS)/paper --force
	$(BIN)/tissuq fit brain-cortex-uniaxial --material neo-hookean --discrepancy all --out $(RUNS)/brain --force
	@echo
	@echo "Reports, to open in a browser:"
	@echo "  the paper's study:  $(abspath $(RUNS))/paper/report.html"
	@echo "  human brain cortex: $(abspath $(RUNS))/brain/report.html"

test: $(VENV)/.installed-dev  ## Run the quick tests (four to five minutes on two cores)
	$(PYTEST) -m 'not ($(LONG))'

test-rest: $(VENV)/.installed-dev  ## Run the tests that `make test` leaves out
	$(PYTEST) -m '$(LONG)'

test-all: $(VENV)/.installed-dev  ## Run every test
	$(PYTEST)

coverage: $(VENV)/.installed-dev  ## Run every test, and say how much of each file they reach (half as long again on Python 3.11)
	$(PYTEST) --cov=src/tissuq --cov-report=term:skip-covered

mutants: $(VENV)/.installed-dev  ## Plant faults in copies of the source and see that tests catch each (ten minutes)
	$(BIN)/python tests/mutants.py

fuzz: $(VENV)/.installed-dev  ## Read ten thousand files mutated at random, and see that each is read or refused (three minutes)
	$(BIN)/python tests/fuzz.py --files 10000

frozen: $(VENV)/.installed-dev  ## Hold reference posteriors against their stored numbers (a minute, at first two)
	JAX_COMPILATION_CACHE_DIR=$(abspath $(JAX_CACHE)) JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0.3 \
	  $(BIN)/python -W ignore tests/frozen/check.py

architecture:  ## Write the table of files in docs/architecture.md
	$(PYTHON) docs/architecture_table.py

docs: $(VENV)/.installed-docs  ## Build the documentation site in build/site, its examples run (a minute and a half on two cores)
	JAX_COMPILATION_CACHE_DIR=$(abspath $(VENV))/jax-cache JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0 \
	  NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build
	@echo "The site, to open in a browser: $(abspath build/site/index.html)"

lint: $(VENV)/.installed-dev  ## Check style and format
	$(BIN)/ruff check src tests benchmarks docs
	$(BIN)/ruff format --check src tests benchmarks docs

types: $(VENV)/.installed-dev  ## Check types
	$(BIN)/mypy

check: lint types test test-rest  ## Everything that CI checks

# These are no Python packages. Where they cannot be installed the tests that need them skip, so that this never fails.
system:  ## Install CalculiX, which judges material cards in the tests, and Chromium, which opens pages (Debian, Ubuntu)
	@if command -v ccx >/dev/null && command -v chromium >/dev/null; then \
	  echo "CalculiX is here: $$(command -v ccx), and Chromium: $$(command -v chromium)"; \
	elif ! command -v apt-get >/dev/null; then \
	  echo "CalculiX (ccx) is not here, and nor is apt-get: install it from https://www.calculix.de or with conda"; \
	  echo "(conda install -c conda-forge calculix) and put ccx and Chromium on the PATH. Without them some tests skip."; \
	elif [ "$$(id -u)" -eq 0 ]; then $(APT); \
	elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then sudo sh -c '$(APT)'; \
	else echo "To install CalculiX and Chromium: sudo apt-get install calculix-ccx chromium. Without them some tests skip."; fi \
	|| echo "CalculiX or Chromium could not be installed; the tests that need them skip."

bench: $(BENCH)/.installed  ## Time tissuq by itself and beside other libraries; writes benchmarks/RESULTS.md (half an hour)
	$(BENCH)/bin/python benchmarks/cold_start.py
	$(BENCH)/bin/python benchmarks/engine.py
	$(BENCH)/bin/python benchmarks/nonlinear.py
	$(BENCH)/bin/python benchmarks/population.py
	$(BENCH)/bin/python benchmarks/compare.py

$(BENCH)/.installed: pyproject.toml benchmarks/constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 12) <= sys.version_info[:2] <= (3, 13))' || \
	  { echo "the other libraries' newest releases need Python 3.12 or 3.13. Try: make bench PYTHON=python3.13"; exit 1; }
	$(PYTHON) -m venv $(BENCH)
	$(BENCH)/bin/python -m pip install --quiet --constraint benchmarks/constraints.txt --editable '.[bench]'
	touch $@

lock: $(VENV)/.installed-dev $(VENV)/.installed-docs  ## Write the installed versions to constraints.txt
	{ sed -n 1p constraints.txt; $(BIN)/python -m pip list --format=freeze --exclude tissuq --exclude pip --exclude setuptools; } > constraints.new
	mv constraints.new constraints.txt

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "tissuq needs Python 3.11 or later, but '$(PYTHON)' is $$($(PYTHON) -V 2>&1). Try: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@

$(VENV)/.installed-docs: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

clean:  ## Remove the environment and caches
	rm -rf $(VENV) $(BENCH) .pytest_cache $(JAX_CACHE) .mypy_cache .ruff_cache .coverage build dist
