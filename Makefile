# Each target installs its requirements in .venv. A fresh Debian or Ubuntu needs python3 (3.11 or newer) and
# python3-venv. With python3-dev and g++ the kernels are compiled, which is faster. Films need libosmesa6.
SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

PYTHON3 ?= python3
PYTHON := .venv/bin/python
STAMP := .venv/ready
SEEDS ?= 1
ANNOTATIONS ?= 0
PYTEST = $(PYTHON) -m pytest --numprocesses auto --maxprocesses 8 --dist worksteal --durations 20 --seeds $(SEEDS) \
    $(if $(filter-out 0,$(ANNOTATIONS)),--check-annotations)
PROSE := src docs README.md CONTRIBUTING.md CHANGELOG.md examples reproductions benchmarks
KERNELS := $(wildcard CMakeLists.txt src/pilotfish/kernels/*.cpp src/pilotfish/kernels/*.hpp src/pilotfish/kernels/*/*.cpp src/pilotfish/kernels/*/*.hpp)

# Recorded demonstrations: the folder beside the checkout, if it exists. Without it, public data sets are downloaded, and
# tests that need other data sets are skipped.
ifndef PILOTFISH_DATA
ifneq ($(wildcard ../shared/data),)
export PILOTFISH_DATA := $(abspath ../shared/data)
endif
endif

export PYTHONDONTWRITEBYTECODE :=# keep bytecode, which makes imports faster
export OPENBLAS_NUM_THREADS ?= 1# more threads are slower on small matrices

.PHONY: help demo test slow lint docs check fuzz bench reproduce clean

help: ## list the targets
	@grep -hE '^[a-z]+:.*## ' Makefile | sed -E 's/^([a-z]+):.*## /\1\t/' | expand -t 12

demo: $(STAMP) ## learn to open a valve, reproduce it in new situations, write a report: build/demo
	.venv/bin/pilotfish demo --out build/demo

test: $(STAMP) ## run the tests that are not slow; SEEDS=3: random data of three seeds; ANNOTATIONS=1: annotations are checked
	$(PYTEST) -m "not slow"

slow: $(STAMP) ## run the slow tests: scripts, killed processes, full disks, installation, mutation tests
	$(PYTEST) -m slow

lint: $(STAMP) ## check format, lint rules, types, spelling and imports
	.venv/bin/ruff format --check
	.venv/bin/ruff check
	.venv/bin/mypy
	.venv/bin/codespell -D - -D .ci/british.txt
	.venv/bin/codespell -D .ci/refused.txt $(PROSE)
	.venv/bin/lint-imports --no-cache

docs: $(STAMP) ## build the documentation site with warnings as errors: build/docs/index.html
	$(PYTHON) -m sphinx -q -W --keep-going -b html -d build/doctrees docs build/docs
	@echo "$$(find build/docs -name '*.html' | wc -l) pages: build/docs/index.html"

check: SEEDS = 3
check: ANNOTATIONS = 1
check: lint slow test ## lint, then run all tests with three seeds and annotation checks

fuzz: $(STAMP) ## fuzz every decoder and public function with a million inputs; PILOTFISH_FUZZ=N sets the number
	$(PYTHON) tests/fuzz/run.py

bench: $(STAMP) ## compare run times with other libraries
	$(PYTHON) benchmarks/run.py

reproduce: $(STAMP) ## repeat the experiments of the thesis: build/reproductions
	mkdir -p build/reproductions
	for file in reproductions/*.py; do \
	    name=$$(basename "$$file" .py); \
	    echo "== $$name"; \
	    $(PYTHON) "$$file" --json "build/reproductions/$$name.json" --out "build/reproductions/$$name"; \
	done

clean: ## remove everything that make created
	rm -rf .venv build .pytest_cache .mypy_cache .ruff_cache .hypothesis src/pilotfish/kernels/*.so
	find src tests benchmarks reproductions examples -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true

# The installation is editable; a change of the C++ sources runs this rule again.
$(STAMP): pyproject.toml constraints.txt .ci/set-up $(KERNELS)
	PYTHON3=$(PYTHON3) .ci/set-up
	touch $@
