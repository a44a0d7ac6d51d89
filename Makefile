# The two commands of a newcomer: `make demo` and `make test`. Both install what they need into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= results

.PHONY: help demo test test-slow test-browser docs faults proofs lint bench clean

help:
	@echo "make demo   install, run scans/paper.toml and the paper report, say where the results are"
	@echo "make test   install and run the tests, but for slow ones"
	@echo "make test-slow   those"
	@echo "make test-browser   the live explorer in chromium"
	@echo "make docs   the documentation as pages, in docs/_build"
	@echo "make faults   kill runs, fill disks and damage files, to see whether results survive"
	@echo "make proofs   proved lists of 2,000 random mechanisms beside Newton's method from many starts"
	@echo "make lint   formatter, linter and type checker"
	@echo "make bench  speed against error, side by side with other integrators"
	@echo "make clean  remove the virtual environment and build output (results stay)"

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "fastmech needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)

# One stamp for each set of extras: what is installed is not installed again.
$(VENV)/.demo: $(BIN)/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[xarray]'
	@touch $@

$(VENV)/.test: $(BIN)/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	@touch $@ $(VENV)/.demo

$(VENV)/.browser: $(VENV)/.test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[browser]'
	@touch $@

$(VENV)/.lint: $(BIN)/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,lint]'
	@touch $@ $(VENV)/.test $(VENV)/.demo

demo: $(VENV)/.demo
	$(BIN)/fastmech run scans/paper.toml --out $(OUT)/paper.h5 --fresh
	$(BIN)/fastmech plot $(OUT)/paper.h5 --out $(OUT)/paper
	$(BIN)/fastmech paper --out $(OUT)/report
	@echo
	@echo "Results:  $(OUT)/paper.h5          (fastmech info $(OUT)/paper.h5)"
	@echo "Pictures: $(OUT)/paper/"
	@echo "Report:   $(OUT)/report/report.html (the paper's tables and figures, printed against computed)"

# Compiled; then small tests of kernels in plain Python, where a silent trap of compiled code shows as an exception;
# then the kernels' tests with every array index checked, less optimized, which compiles sooner. Neighbours among the
# tests share kernels: each process begins with a half of them. Of the small tests only their own files are imported.
TESTS := $(BIN)/python -m pytest -n auto --dist worksteal
SMALL := -m 'nojit and not slow' $(shell grep -rl --include='test_*.py' nojit tests)

test: $(VENV)/.test
	$(TESTS) -m 'not slow'
	NUMBA_DISABLE_JIT=1 $(TESTS) $(SMALL)
	NUMBA_BOUNDSCHECK=1 NUMBA_OPT=1 $(TESTS) $(SMALL)

# Those that take long; then what the explorer is measured by, alone and warm.
test-slow: $(VENV)/.test $(VENV)/.browser
	$(TESTS) -m slow -k 'not budgets'
	$(BIN)/python -m pytest tests/explore/test_browser.py -s -k budgets

# The explorer in a real browser, Debian's chromium.
test-browser: $(VENV)/.browser
	$(BIN)/python -m pytest tests/explore/test_browser.py -n auto -m 'not slow'

# Warnings are errors; nothing is fetched from a network.
docs: $(VENV)/.test
	$(BIN)/python -m sphinx -W --keep-going -q -j auto docs docs/_build
	@echo "Pages: docs/_build/index.html"

# Hours of interruptions; FAULTS="--kills 20 --mutations 0" and the like do less.
faults: $(VENV)/.test
	PYTHONPATH=tests $(BIN)/python -m faults $(FAULTS)

proofs: $(VENV)/.test
	PYTHONPATH=tests $(BIN)/python -m proofs

lint: $(VENV)/.lint
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

bench: $(VENV)/.demo
	$(BIN)/fastmech bench --out $(OUT)/bench

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
