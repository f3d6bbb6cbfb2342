# Everything works on a machine with Python 3.11 or later, git and make: the targets create .venv themselves.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
TEST_READY := $(VENV)/.ready-test
CHECK_READY := $(VENV)/.ready-check
ACCEPT_READY := $(VENV)/.ready-accept
BENCH_READY := $(VENV)/.ready-bench
DOCS_READY := $(VENV)/.ready-docs
# `make test ORDER=` runs the tests in random order.
ORDER ?= -p no:randomly
# `make test MARKS='not slow'` runs the tests with a browser too, as .ci/run does.
MARKS ?= not slow and not browser
PYTEST = $(BIN)/python -m pytest -n 2 --dist loadfile -q $(ORDER)
export PIP_DISABLE_PIP_VERSION_CHECK = 1
# Compiled modules are kept: without them each of the processes that tests start compiles all sources anew.
unexport PYTHONDONTWRITEBYTECODE
# Tests run in two processes on two cores: linear algebra with threads of its own would wait for theirs.
test test-all coverage: export OPENBLAS_NUM_THREADS = 1
test test-all coverage: export OMP_NUM_THREADS = 1

.PHONY: help demo test test-all coverage check accept bench assets docs lowest format clean

help:  ## show this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 12

# Each stands for what it installs and for what those before it do, in one run of pip.
$(READY): pyproject.toml
	test -d $(VENV) || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --editable .
	@touch $@

$(TEST_READY): pyproject.toml
	test -d $(VENV) || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --editable '.[test]'
	@touch $(READY) $@

$(CHECK_READY): pyproject.toml
	test -d $(VENV) || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[test,check]'
	@touch $(READY) $(TEST_READY) $@

demo: $(READY)  ## build a PUMA 560 from its table, verify it, write out/puma560/
	$(BIN)/dhkit demo

test: $(TEST_READY)  ## the tests but those that take seconds, laws at a small sample size
	$(PYTEST) -m '$(MARKS)' $(ARGS)

test-all: $(TEST_READY)  ## all tests, laws at a small sample size
	$(PYTEST) $(ARGS)

coverage: $(TEST_READY)  ## the same traced: which lines they run; 90 % at least
	$(PYTEST) --cov=dhkit --cov-report=term:skip-covered --cov-fail-under=90

check: $(CHECK_READY)  ## ruff, mypy --strict, import order, shape of the package
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tools.architecture

accept: $(ACCEPT_READY)  ## the laws at full size, example-robot-data's chains too; writes benchmarks/results/acceptance.json
	DHKIT_ACCEPT=1 $(BIN)/python -m pytest -m law -q --no-header -p no:randomly tests

$(ACCEPT_READY): $(TEST_READY)
	$(BIN)/python -m pip install --quiet --editable '.[test,robots]'
	@touch $@

bench: $(BENCH_READY)  ## kinematics, dynamics, motions and simulation beside peers; writes benchmarks/results/
	$(BIN)/python -m benchmarks.kinematics $(ARGS)
	$(BIN)/python -m benchmarks.kinematics --robot panda --no-probes --output benchmarks/results/kinematics_panda
	$(BIN)/python -m benchmarks.kinematics --robot jaco --no-probes --output benchmarks/results/kinematics_jaco
	$(BIN)/python -m benchmarks.dynamics $(ARGS)
	$(BIN)/python -m benchmarks.dynamics --robot panda --no-probes --output benchmarks/results/dynamics_panda
	$(BIN)/python -m benchmarks.planning
	$(BIN)/python -m benchmarks.planning_cases
	$(BIN)/python -m benchmarks.scenes
	$(BIN)/python -m benchmarks.scenes --kind spheres --scenes 48 --compared 0 --output benchmarks/results/scenes_spheres
	$(BIN)/python -m benchmarks.scenes --kind itself --scenes 30 --compared 6 --output benchmarks/results/scenes_itself
	$(BIN)/python -m benchmarks.control
	$(BIN)/dhkit bench --problems benchmarks/problems --output benchmarks/results/problems
	$(BIN)/python -m tools.readme_table

$(BENCH_READY): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[bench]'
	@touch $@

assets: $(READY)  ## generate urdf/, meshes/, the tables of docs/control.md and the pictures of docs/lab.md anew
	$(BIN)/python -m tools.assets
	$(BIN)/python -m benchmarks.controllers
	$(BIN)/python docs/screenshots.py

docs: $(DOCS_READY)  ## the site in out/docs, with its pictures and tables; `dhkit docs` shows it
	$(BIN)/python docs/make_site.py $(ARGS)

$(DOCS_READY): pyproject.toml
	test -d $(VENV) || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	@touch $(READY) $@

lowest:  ## the tests with the oldest versions that pyproject.toml allows
	$(PYTHON) -m venv $(VENV)-lowest
	$(VENV)-lowest/bin/python -m pip install --quiet uv
	VIRTUAL_ENV=$(VENV)-lowest $(VENV)-lowest/bin/uv pip install --quiet --resolution lowest-direct --editable '.[test]'
	$(VENV)-lowest/bin/python -m pytest -n 2 --dist loadfile -q $(ORDER) -W ignore::DeprecationWarning tests

format: $(CHECK_READY)  ## let ruff format the sources
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:  ## remove what was built
	rm -rf $(VENV) $(VENV)-lowest .cache out dist build .mypy_cache .ruff_cache .pytest_cache .hypothesis
