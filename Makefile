# Each target sets up what it needs in .venv. A fresh Debian or Ubuntu needs python3 (3.11 or newer), python3-venv,
# python3-dev and g++; without the last two everything works too, slower. Films of the physics need libosmesa6.
SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

PYTHON3 ?= python3
PYTHON := .venv/bin/python
READY := .venv/ready
SEEDS ?= 1
PYTEST = $(PYTHON) -m pytest --numprocesses auto --maxprocesses 8 --dist worksteal --durations 20 --seeds $(SEEDS)
PROSE := src docs README.md CONTRIBUTING.md CHANGELOG.md examples reproductions benchmarks
KERNELS := $(wildcard CMakeLists.txt src/pilotfish/kernels/*.cpp src/pilotfish/kernels/*.hpp src/pilotfish/kernels/*/*.cpp src/pilotfish/kernels/*/*.hpp)

# Real recordings: the folder beside the checkout when there is one. Without it the library fetches what is public, and
# the tests that need the others are skipped.
ifndef PILOTFISH_DATA
ifneq ($(wildcard ../shared/data),)
export PILOTFISH_DATA := $(abspath ../shared/data)
endif
endif

export PYTHONDONTWRITEBYTECODE :=# bytecode is kept, so that an import stays quick
export OPENBLAS_NUM_THREADS ?= 1# the matrices are small: more threads are slower

.PHONY: help demo test slow lint docs check fuzz bench reproduce clean

help: ## list these targets
	@grep -hE '^[a-z]+:.*## ' Makefile | sed -E 's/^([a-z]+):.*## /\1\t/' | expand -t 12

demo: $(READY) ## learn the valve task, reproduce it in new situations, draw it: build/demo
	.venv/bin/pilotfish demo --out build/demo

test: $(READY) ## run every test that is not slow; SEEDS=3 runs those that depend on chance with three seeds
	$(PYTEST) -m "not slow"

slow: $(READY) ## run the slow tests: whole scripts, processes that are killed, full disks, installs, mutants
	$(PYTEST) -m slow

lint: $(READY) ## format, lint, types and spelling
	.venv/bin/ruff format --check
	.venv/bin/ruff check
	.venv/bin/mypy
	.venv/bin/codespell -D - -D .ci/british.txt
	.venv/bin/codespell -D .ci/refused.txt $(PROSE)
	.venv/bin/lint-imports --no-cache

docs: $(READY) ## build the documentation site, warnings are errors: build/docs/index.html
	$(PYTHON) -m sphinx -q -W --keep-going -b html -d build/doctrees docs build/docs
	@echo "$$(find build/docs -name '*.html' | wc -l) pages, begin with build/docs/index.html"

check: SEEDS = 3
check: lint slow test ## lint, then run every test with three seeds

fuzz: $(READY) ## give a million hostile inputs to every decoder and public function: PILOTFISH_FUZZ=N sets how many
	$(PYTHON) tests/fuzz/run.py

bench: $(READY) ## time pilotfish beside its peers
	$(PYTHON) benchmarks/run.py

reproduce: $(READY) ## the thesis' experiments: build/reproductions
	mkdir -p build/reproductions
	for file in reproductions/*.py; do \
	    name=$$(basename "$$file" .py); \
	    echo "== $$name"; \
	    $(PYTHON) "$$file" --json "build/reproductions/$$name.json" --out "build/reproductions/$$name"; \
	done

clean: ## remove all that make made
	rm -rf .venv build .pytest_cache .mypy_cache .ruff_cache .hypothesis src/pilotfish/kernels/*.so
	find src tests benchmarks reproductions examples -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true

# Editable: Python edits count at once; a change of the C++ sources makes this rule run again.
$(READY): pyproject.toml constraints.txt .ci/set-up $(KERNELS)
	PYTHON3=$(PYTHON3) .ci/set-up
	touch $@
