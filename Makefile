# Two commands: `make demo` shows a match, `make test` runs everything CI runs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-long fuzz lint types benchmark clean

$(VENV)/core: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/dev: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $(VENV)/core $@

demo: $(VENV)/core
	$(BIN)/isomatch demo -o demo

test: $(VENV)/dev lint types
	$(BIN)/python -m pytest -n auto --dist loadfile

test-long: $(VENV)/dev
	$(BIN)/python -m pytest -m long

fuzz: $(VENV)/dev
	ISOMATCH_FUZZ_EXAMPLES=$(or $(EXAMPLES),20000) $(BIN)/python -m pytest tests/fuzz -n auto --hypothesis-show-statistics

lint: $(VENV)/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/dev
	$(BIN)/mypy

benchmark: $(VENV)/dev
	$(BIN)/python -m pytest benchmarks/bench_*.py -s -o addopts= -o 'python_functions=bench_*' --benchmark-columns=min,median,rounds

clean:
	rm -rf $(VENV) demo
