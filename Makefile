# On a fresh machine with Python >= 3.11 and make: `make identify` or `make test`.
#   make identify ARGS="--seed 3"   PYTHON=/path/to/python3.12 make test

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.mofit-ready
BENCH := $(VENV)/.mofit-bench
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input
RUN ?= $(shell ls -td runs/*/ 2>/dev/null | head -n 1)
USABLE := import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))

.DELETE_ON_ERROR:
.PHONY: help identify test test-long test-all lint format report docs bench lock clean

help:
	@echo "make identify   set up, then identify the bundled campaign (ARGS=... adds options)"
	@echo "make test       set up, then ruff, mypy and pytest without the long tests"
	@echo "make test-long  the long tests alone"
	@echo "make test-all   make test, then make test-long"
	@echo "make lint       ruff and mypy only"
	@echo "make format     let ruff format and mend what it can"
	@echo "make report     rebuild the report of the newest run (RUN=... names another)"
	@echo "make docs       build the documentation into build/docs"
	@echo "make bench      the kernel benchmark (NAME=... names another)"
	@echo "make lock       renew the locked versions from pyproject.toml"
	@echo "make clean      remove the environment and all caches; runs stay"

identify: $(READY)
	$(BIN)/mofit identify --all-freqs $(ARGS)

test: lint
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow" $(ARGS)

test-all: test test-long

test-long: $(READY)
	$(BIN)/python -m pytest -n 2 --dist loadfile -m slow $(ARGS)

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: $(READY)
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

report: $(READY)
	@test -n "$(RUN)" || { echo "make report: no run yet; 'make identify' makes one" >&2; exit 2; }
	$(BIN)/mofit report $(RUN)

docs: $(READY)
	$(BIN)/python -m sphinx -b html -W --keep-going -q docs build/docs
	@echo "build/docs/index.html"

bench: $(BENCH)
	PYTHONPATH=scripts $(BIN)/python -m benchmarks $(or $(NAME),kernel) $(ARGS)

$(READY): requirements.txt pyproject.toml
	@set -eu; \
	if ! $(BIN)/python -c '$(USABLE)' 2>/dev/null; then \
	  found=; \
	  for python in $(PYTHON) python3.11 python3.12 python3.13 python3.14 python3 python; do \
	    if "$$python" -c '$(USABLE)' 2>/dev/null; then found=$$python; break; fi; \
	  done; \
	  if [ -z "$$found" ]; then \
	    echo "make: found no Python >= 3.11 that can make virtual environments." >&2; \
	    echo "Install one (on Debian and Ubuntu with its venv package: python3-venv), or name it: make PYTHON=/path/to/python3" >&2; \
	    exit 2; \
	  fi; \
	  echo "making $(VENV) with $$found"; \
	  "$$found" -m venv --clear $(VENV); \
	fi; \
	$(BIN)/python -m pip --version >/dev/null 2>&1 || $(BIN)/python -m ensurepip
	@echo "installing the locked packages into $(VENV); the first time this takes a minute or two"
	@$(PIP) install --quiet --requirement requirements.txt
	@$(PIP) install --quiet --no-deps --no-build-isolation --editable .
	@$(BIN)/python -m compileall -q mofit  # starts faster, also where PYTHONDONTWRITEBYTECODE is set
	@touch $@

$(BENCH): $(READY) requirements-bench.txt
	$(PIP) install --quiet --requirement requirements-bench.txt
	@touch $@

# one lock for every Python >= 3.11 and platform (markers); names and versions only
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --custom-compile-command "make lock"
lock: $(READY)
	$(PIP) install --quiet uv
	$(LOCK) --upgrade pyproject.toml --group dev --output-file requirements.txt
	$(LOCK) --upgrade pyproject.toml --extra bench --extra dask --extra excel --extra fmu --extra mcp --extra mdf --extra parquet --constraint requirements.txt --output-file requirements-bench.txt

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
