PYTHON ?= python3
PROBLEM ?= problems/tractor-four-lanchester.toml
STUDY ?= problems/tractor-study.toml

VENV := .venv
BIN := $(VENV)/bin
LANES := -n auto --maxprocesses 8 --dist worksteal
STAMP := $(VENV)/.installed
LOWEST := .venv-lowest
LOWEST_STAMP := $(LOWEST)/.installed
# Every library at work, in about a minute.
SMOKE := tests/problem/test_units.py tests/files/test_reader.py tests/report/test_number_files.py tests/report/test_json_result.py \
	tests/cli/test_commands.py tests/solvers/test_conic.py tests/solvers/test_optimality.py tests/solvers/test_nonlinear.py \
	tests/mounts/test_mount_convex.py tests/phasing/test_known_cases.py tests/extensions/chambers/test_indicator_picture.py tests/studies/test_studies.py \
	tests/extensions/random_studies/test_draws.py

.PHONY: help solve study test test-fast test-long test-lowest lanes attack matrix mutants faults benchmarks proofs speed pictures docs lint format clean distclean

help:
	@echo "make solve      design the balance of PROBLEM ($(PROBLEM))"
	@echo "make study      sweeps and comparisons that STUDY describes ($(STUDY))"
	@echo "make test-fast  tests of every room, and of the extensions that a change reaches; under a minute on two cores"
	@echo "make test       all tests, minutes"
	@echo "make test-long  the long tail of random families, which make test leaves out"
	@echo "make test-lowest  a smoke part of the tests with the lowest versions that pyproject.toml allows, about a minute"
	@echo "make lanes      which tests are too slow for the fast lane, measured; writes tests/slow.txt"
	@echo "make attack     random problems against an independent model, ATTACK='--number 100'"
	@echo "make matrix     every kind of decision, measure and layout together, an hour and more; MATRIX='--share 0.1'"
	@echo "make mutants    300 one-line changes of the source, each against the tests that call it; writes results/mutants/"
	@echo "make lint       style, types, direction of imports"
	@echo "make format     put the source into the project's style"
	@echo "make faults     100,000 damaged files, which writes results/faults/; half an hour and more"
	@echo "make benchmarks every page of results/benchmarks/, BENCHMARKS='growth torsion' for these alone; half an hour"
	@echo "make proofs     every ready problem's value, bound and gap, which writes results/proofs/; minutes"
	@echo "make speed      what users wait for, timed; SPEED=--benchmark-compare against the last run"
	@echo "make pictures   the pictures of README.md again, under docs/pictures/"
	@echo "make docs       the documentation site, docs/_build/index.html"
	@echo "make clean      remove caches; make distclean removes $(VENV) and $(LOWEST) as well"
	@echo "TESTS='-k name' goes to pytest"

# pip from Python 3.11 knows no dependency groups, so the pinned pip comes first.
$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Laufruhe needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade --constraint constraints.txt pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --build-constraint constraints.txt --editable .[all] --group dev
	@touch $@

$(LOWEST_STAMP): pyproject.toml constraints-lowest.txt
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --upgrade --constraint constraints-lowest.txt pip
	$(LOWEST)/bin/python -m pip install --quiet --constraint constraints-lowest.txt --build-constraint constraints-lowest.txt --editable .[all] --group smoke
	@touch $@

solve: $(STAMP)
	$(BIN)/laufruhe solve $(PROBLEM)

study: $(STAMP)
	$(BIN)/laufruhe study $(STUDY)

# A process for every core, one thread in each. Compiled modules are kept: every process, and every command that a test
# starts, would compile all of them again.
docs test test-fast test-long test-lowest lanes: export OMP_NUM_THREADS = 1
test test-fast test-long test-lowest lanes: export PYTHONDONTWRITEBYTECODE =

test: $(STAMP)
	$(BIN)/python -m pytest $(LANES) $(TESTS)

test-fast: $(STAMP)
	$(BIN)/python -m pytest $(LANES) -m "not slow" --hypothesis-profile=fast --changed $(TESTS)

test-long: $(STAMP)
	$(BIN)/python -m pytest $(LANES) --long $(TESTS)

# What an old library says of the newer ones below it is no fault here.
test-lowest: $(LOWEST_STAMP)
	$(LOWEST)/bin/python -m pytest $(LANES) -m "not slow" --hypothesis-profile=fast -W ignore::DeprecationWarning $(SMOKE)

# What each test takes of a core decides its lane. Once more, because what a test shares falls to the next one then.
lanes: $(STAMP)
	$(BIN)/python -m pytest $(LANES) -m "not slow" --hypothesis-profile=fast --relist=anew $(TESTS)
	$(BIN)/python -m pytest $(LANES) -m "not slow" --hypothesis-profile=fast --relist=more $(TESTS)

# What the log under results/attack/ has is not run again.
attack: export OMP_NUM_THREADS = 1

attack: $(STAMP)
	$(BIN)/python tests/attack/bodies.py
	$(BIN)/python tests/attack/run_attack.py run all $(ATTACK)
	$(BIN)/python tests/attack/run_attack.py page results/attack/*.jsonl

matrix: export OMP_NUM_THREADS = 1

matrix: $(STAMP)
	$(BIN)/python tests/matrix/whole.py $(MATRIX)

# One-line changes of the source that no test sees; writes results/mutants/README.md.
mutants: export OMP_NUM_THREADS = 1

mutants: $(STAMP)
	$(BIN)/python tests/mutants/run_mutants.py map
	$(BIN)/python tests/mutants/run_mutants.py run --page $(MUTANTS)

# Scripts that write results/benchmarks/, one after the other, none for longer than a quarter of an hour.
benchmarks: export OMP_NUM_THREADS = 1

benchmarks: $(STAMP)
	$(BIN)/python tests/benchmarks/every.py $(BENCHMARKS)

# Value, bound, gap and time of every ready problem; writes results/proofs/README.md.
proofs: $(STAMP)
	$(BIN)/python tests/benchmarks/proofs.py

speed: $(STAMP)
	$(BIN)/python -m pytest tests/benchmarks/speed.py -o addopts="" -p no:xdist --import-mode=importlib --benchmark-autosave --benchmark-storage=.benchmarks $(SPEED)

# A hundred thousand damaged files through the commands; writes results/faults/README.md.
faults: export OMP_NUM_THREADS = 1
faults: $(STAMP)
	$(BIN)/python tests/faults/run_faults.py

pictures: $(STAMP)
	$(BIN)/python tests/benchmarks/make_pictures.py

# A warning is an error; nothing is fetched.
docs: $(STAMP)
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --builder html docs docs/_build

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --strict src docs/examples
	$(BIN)/lint-imports

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf build dist docs/_build docs/gallery docs/measured docs/jupyter_execute docs/sg_execution_times.rst .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests -type d -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV) $(LOWEST)
