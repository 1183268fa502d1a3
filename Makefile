# `make` lists what there is. Two commands do everything on a fresh machine with Python 3.11 and make: `make run`, `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RECORDINGS := recordings
BASELINES := tests/baselines
NIGHT := regress
# uv needs 4 s for what takes pip half a minute; pip takes over, and uv has said why, where only pip knows the way to an index.
# Python compiles the modules that are imported, when they are: of thousands in a fresh environment few ever are
install = $(BIN)/uv pip install --quiet --python $(BIN)/python -c constraints.txt $(1) || $(call pip,$(1))
pip = $(BIN)/python -m pip install --no-compile --quiet --disable-pip-version-check -c constraints.txt $(1)
PHANTOMS := pyskindose  # human bodies for the shipped scenarios; its own dependencies are not needed
TRAJECTORIES := evo  # another tool that compares trajectories, for tests; its core needs NumPy and SciPy alone
# Franka Emika's arm, Apache-2.0
PANDA := cmeel.prefix/share/example-robot-data/robots/panda_description

.DEFAULT_GOAL := help
.PHONY: help setup run regress accept freeze test lint format type schemas bench pictures soak plain mutants clean system

help:  ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## */\1\t/' | awk -F'\t' '{printf "  make %-10s %s\n", $$1, $$2}'

$(VENV)/.run: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(call pip,uv)
	$(call install,-e .)
	$(call install,--no-deps $(PHANTOMS))
	@touch $@

$(VENV)/.test: $(VENV)/.run
	$(call install,-e '.[test]')
	$(call install,--no-deps $(TRAJECTORIES))
	@touch $@

setup: $(VENV)/.run  ## create .venv and install the package and the phantoms

run: setup  ## run every scenario under scenarios/ and say where the recordings are
	$(BIN)/replay run scenarios -o $(RECORDINGS) --overwrite
	@echo
	@echo "Recordings are in $(RECORDINGS)/<scenario>/. Look at one with:"
	@echo "  $(BIN)/replay view $(RECORDINGS)/carm_head_contact/carm_head_contact.rrd"
	@echo "  $(BIN)/replay info $(RECORDINGS)/carm_head_contact/carm_head_contact.mcap"

regress: setup  ## run every scenario and compare it with its accepted recording; the report is regress/index.html
	@$(BIN)/replay regress scenarios --baseline $(BASELINES) -o $(NIGHT) --timeout 10min || { code=$$?; \
	  echo "If the new results are right: make accept REASON='why they are'"; exit $$code; }

accept: setup  ## make the results of `make regress` the accepted ones: make accept REASON='why'
	$(BIN)/replay accept $(NIGHT) --baseline $(BASELINES) --reason "$(REASON)"

freeze: $(VENV)/.test  ## freeze the readings of methods whose revision was raised
	$(BIN)/python -m tests.frozen

test: $(VENV)/.test system lint type  ## install what is missing, then lint, types and all tests
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(VENV)/.test  ## check style and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(VENV)/.test  ## put every file into the house's format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

type: $(VENV)/.test  ## check types
	$(BIN)/mypy

schemas: $(VENV)/.test  ## write the generated schemas again
	$(BIN)/python -m replay.scenario.schema
	$(BIN)/python -m replay.comparison.rules_file
	$(BIN)/python -m replay.scenario.reference

robot: setup  ## import the shipped robot again from its package
	$(call install,--no-deps example-robot-data)
	model=$$($(BIN)/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/$(PANDA) && \
	  $(BIN)/replay import $$model/urdf/panda.urdf --srdf $$model/srdf/panda.srdf --copy-meshes --root-pose '0 0 80cm' \
	    --acceleration '2 rad/s^2' --acceleration '1 m/s^2' --overwrite -o scenarios/parts/panda.yaml && \
	  sed -i '1i # yaml-language-server: $$schema=../../schemas/fragment.schema.json' scenarios/parts/panda.yaml && \
	  cp $$model/LICENSE scenarios/parts/panda/

bench: setup  ## speed against error, ours and other engines' (about ten minutes); the report is recordings/bench/bench.html
	$(call install,-e '.[bench]')
	$(BIN)/replay bench -o $(RECORDINGS)/bench || [ $$? = 1 ]  # a goal that is missed is told, and no reason to stop
	cp $(RECORDINGS)/bench/bench.png scenarios/pictures/speed_against_error.png

pictures: $(VENV)/.test system  ## make the README's pictures, most of them from the recordings that `make run` left
	mkdir -p scenarios/pictures
	$(BIN)/replay view $(RECORDINGS)/carm_head_contact/carm_head_contact.rrd --screenshot scenarios/pictures/carm_head_contact.png --at 3.6
	$(BIN)/replay view $(RECORDINGS)/carm_parking/carm_parking.rrd --screenshot scenarios/pictures/carm_parking.png --at 4.2
	$(BIN)/replay view $(RECORDINGS)/panda_meets_person/panda_meets_person.rrd --screenshot scenarios/pictures/panda_meets_person.png --at 2.8
	$(BIN)/replay run scenarios/carm_parking.yaml -o $(RECORDINGS)/.thesis --model thesis2015 --no-rrd --overwrite
	$(BIN)/replay run scenarios/carm_parking.yaml -o $(RECORDINGS)/.ours --no-rrd --overwrite
	$(BIN)/replay diff $(RECORDINGS)/.thesis $(RECORDINGS)/.ours --rules scenarios/rules.yaml --html $(RECORDINGS)/.html || test $$? = 1
	$(BIN)/python -m tests.pictures signal $(RECORDINGS)/.html /distance/corner_foot_left/distance scenarios/pictures/thesis_and_ours.png
	$(BIN)/python -m tests.pictures reaction $(RECORDINGS) scenarios/pictures/reaction_time.png
	$(BIN)/replay compare scenarios/carm_parking_measured.yaml --html $(RECORDINGS)/.html
	$(BIN)/python -m tests.pictures signal $(RECORDINGS)/.html /distance/corner_foot_left/distance scenarios/pictures/beside_the_machine.png

soak: $(VENV)/.test  ## the long versions of the tests: millions of pairs, thousands of damaged files
	$(call install,-e '.[test,soak]')
	$(call install,--no-deps example-robot-data)
	$(BIN)/python -m pytest -m soak

plain: $(VENV)/.test  ## every test with kernels as plain Python, as in a debugger; those that take long so with fewer cases
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -n 2 --dist loadfile

mutants: $(VENV)/.test  ## do the tests notice? planted faults, and 330 mutants over all rooms (hours); goes on where it stopped
	$(BIN)/python -m tests.mutants.run --planted
	$(BIN)/python -m tests.mutants.run

system:  # a software Vulkan driver for the viewer; for tests a browser, certificates, and what a process asks the system
	@ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 && \
	  (for tool in chromium openssl strace; do command -v $$tool >/dev/null || exit 1; done) || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	    apt-get update -qq && apt-get install -qq -y --no-install-recommends mesa-vulkan-drivers chromium openssl strace >/dev/null; \
	  else echo "screenshots need a Vulkan driver, tests a browser, openssl and strace" \
	    "(Debian: apt-get install mesa-vulkan-drivers chromium openssl strace)" >&2; fi; }

clean:  ## remove the environment, recordings and caches
	rm -rf $(VENV) $(RECORDINGS) $(NIGHT) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
