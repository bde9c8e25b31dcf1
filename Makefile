# `make demo` shows a match, `make test` and `make test-kernel` run what CI runs, `make docs` builds the site.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
LOWEST := $(VENV)/lowest
DOCS := $(VENV)/docs
LOCK := requirements-dev.txt
PYTHONS ?= 3.11 3.12 3.13
UV := $(VENV)/uv/bin/uv
PIP := -m pip install --quiet --disable-pip-version-check --no-compile  # Python compiles what is imported
KERNEL ?= Prescott # of OpenBLAS, the plainest of an x86 processor
KERNEL_FREE := array_shapes bad_input config landmark_files outcome parameters result_file # compute nothing that it changes
TESTS ?= $(filter-out $(KERNEL_FREE:%=tests/matching/test_%.py),$(wildcard tests/matching/test_*.py)) # that match or decompose
ONE_THREAD := ISOMATCH_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1  # for each worker
WORKERS := -n auto --dist loadfile --no-loadscope-reorder  # a worker for each processor, files in the order of conftest.py

unexport PYTHONDONTWRITEBYTECODE # or each of the processes that tests start compiles every module again

.PHONY: demo docs docs-dev extras test test-kernel test-long fuzz coverage lint types benchmark results lock lowest release release-check clean

# with pip if uv fails
$(BIN)/python: | $(UV)
	$(UV) venv --quiet --seed --allow-existing --python $(PYTHON) $(VENV) || $(PYTHON) -m venv $(VENV)

$(VENV)/core: pyproject.toml | $(BIN)/python
	$(UV) pip install --quiet --python $(BIN)/python -e . || $(BIN)/python $(PIP) -e .
	@touch $@

$(VENV)/dev: pyproject.toml $(LOCK) | $(BIN)/python
	$(UV) pip install --quiet --python $(BIN)/python --require-hashes -r $(LOCK) || \
		$(BIN)/python $(PIP) --require-hashes -r $(LOCK)
	$(BIN)/python $(PIP) --no-deps --no-build-isolation -e .
	@touch $(VENV)/core $@

$(UV):
	-$(PYTHON) -m venv $(VENV)/uv && $(VENV)/uv/bin/python $(PIP) uv

demo: $(VENV)/core
	$(BIN)/isomatch demo -o demo

$(DOCS)/bin/sphinx-build: pyproject.toml
	rm -rf $(DOCS)
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python $(PIP) -e '.[docs]'
	@touch $@

docs: $(DOCS)/bin/sphinx-build
	NUMBA_CACHE_DIR=$(CURDIR)/$(DOCS)/loops $< -n -W --keep-going docs docs/_build/html

docs-dev: $(DOCS)/bin/sphinx-build  # for developers: subpackages, laboratory, decisions, releases
	$< -n -W --keep-going docs/dev docs/_build/dev

extras:  # zips for Blender and 3D Slicer
	$(PYTHON) extras/zipped.py dist/extras

# types are checked beside the tests and told in the end; no two workers compile the same loops and modules
test: $(VENV)/dev lint
	$(BIN)/mypy >$(VENV)/types 2>&1 & checked=$$!; \
	$(ONE_THREAD) $(BIN)/python -m isomatch.warm; \
	test -e $(VENV)/imported || $(BIN)/python -m pytest --collect-only >$(VENV)/imported 2>&1; \
	$(ONE_THREAD) $(BIN)/python -m pytest $(WORKERS); tested=$$?; \
	wait $$checked; typed=$$?; cat $(VENV)/types; exit $$((tested | typed))

test-kernel: $(VENV)/dev
	OPENBLAS_CORETYPE=$(KERNEL) $(ONE_THREAD) $(BIN)/python -m pytest $(WORKERS) $(TESTS)

test-long: $(VENV)/dev
	$(ONE_THREAD) $(BIN)/python -m pytest -m long $(WORKERS)

fuzz: $(VENV)/dev
	ISOMATCH_FUZZ_EXAMPLES=$(or $(EXAMPLES),20000) $(BIN)/python -m pytest tests/fuzz -n auto --hypothesis-show-statistics

coverage: $(VENV)/dev
	$(BIN)/python -m pytest -m "long or not long" $(WORKERS) --cov

lint: $(VENV)/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python release/check_wording.py src

types: $(VENV)/dev
	$(BIN)/mypy

benchmark: $(VENV)/dev
	$(BIN)/python -m isomatch_lab.studies.performance -o $(or $(OUT),performance) $(if $(DATA),--data $(DATA))

results: $(VENV)/dev
	$(BIN)/python -m isomatch_lab.studies.results $(if $(DATA),--data $(DATA),--list) $(if $(OUT),-o $(OUT)) $(STEPS)

lock: $(UV)
	$(UV) pip compile --quiet --upgrade --universal --generate-hashes --no-strip-extras --no-annotate --no-emit-index-url \
		--python-version 3.11 --extra dev --custom-compile-command 'make lock' -o $(LOCK) pyproject.toml

lowest: $(UV)
	$(UV) venv --quiet --clear --python 3.11 $(LOWEST)
	$(UV) pip install --quiet --python $(LOWEST) --resolution lowest-direct -e '.[test]'
	NUMBA_CACHE_DIR=$(CURDIR)/$(LOWEST)/loops $(LOWEST)/bin/python -m pytest $(WORKERS) \
		$(addprefix tests/,surfaces io repair decimation geodesics spectral descriptors correspondence matching cohort/shape_statistics lab/baselines visualization cli)

release: $(UV)  # all that is published, in dist
	PATH="$(CURDIR)/$(VENV)/uv/bin:$$PATH" $(PYTHON) release/build.py

release-check: $(VENV)/dev $(UV)
	PATH="$(CURDIR)/$(VENV)/uv/bin:$$PATH" $(BIN)/python release/check.py $(PYTHONS)

clean:
	rm -rf $(VENV) demo dist performance docs/_build docs/gallery docs/reference/names docs/reference/subpackages
