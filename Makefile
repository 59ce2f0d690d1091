PYTHON ?= python3
PROBLEM ?= problems/tractor-four-lanchester.toml

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: help solve study test bench lint format clean distclean

help:
	@echo "make solve   design the balance of PROBLEM ($(PROBLEM))"
	@echo "make study   sweeps and comparisons that PROBLEM describes"
	@echo "make test    all tests but benchmarks"
	@echo "make bench   benchmarks"
	@echo "make lint    style, types and the direction of imports"
	@echo "make format  put the source into the project's style"
	@echo "make clean   remove caches; make distclean removes $(VENV) as well"

# pip from Python 3.11 knows no dependency groups, so the pinned pip comes first.
$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Laufruhe needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade --constraint constraints.txt pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --build-constraint constraints.txt --editable . --group dev
	@touch $@

solve: $(STAMP)
	$(BIN)/laufruhe solve $(PROBLEM)

study: $(STAMP)
	$(BIN)/laufruhe study $(PROBLEM)

test: $(STAMP)
	$(BIN)/python -m pytest

# Benchmarks are scripts that write under results/. pytest answers 5 when no test carries the marker.
bench: $(STAMP)
	@set -e; for script in tests/benchmarks/bench_*.py; do \
		if [ -e "$$script" ]; then echo "$$script"; $(BIN)/python "$$script"; fi; \
	done
	$(BIN)/python -m pytest -m benchmark || [ $$? -eq 5 ]

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict src
	$(BIN)/lint-imports

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests -type d -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
