# Every target makes its own virtual environment first: a machine with Python 3.11, make and gcc is enough.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check
HAMEL  := $(BIN)/hamel
DEMO   := build/demo
ROBOTS := build/robots/venv
TRIALS := build/trials
BENCH  := build/bench/venv
TARGETS_VENV := build/targets/venv
PEERS  := pin cmeel-eigen example-robot-data mujoco casadi symforce pydy jax numba scipy exudyn heyoka diffrax joblib

# Every process reads its modules as byte code, whatever the surroundings say: tests start hundreds of them.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo report reference gallery docs links book pages live targets target-speed embedded test test-slow lint types robots loops growth bench bench-page report-page whole sweeps cluster matrix faults fuzz fresh clean

demo: $(VENV)/.run-time
	$(HAMEL) build models/snake3.yaml --numpy -o $(DEMO)/snake3
	$(HAMEL) verify models/snake3.yaml
	$(HAMEL) derive models/snake3.yaml -o $(DEMO)/snake3
	$(HAMEL) simulate models/snake3.yaml --set tau1=0.01 --time 5 -o $(DEMO)/snake3.csv --plot $(DEMO)/snake3.svg
	$(HAMEL) build models/four_bar.yaml --numpy -o $(DEMO)/four_bar
	$(HAMEL) verify models/four_bar.yaml
	$(HAMEL) derive models/four_bar.yaml -o $(DEMO)/four_bar
	$(HAMEL) simulate models/four_bar.yaml --time 10 -o $(DEMO)/four_bar.csv --plot $(DEMO)/four_bar.svg
	@echo
	@echo "Modules, motions and plots are in $(DEMO)."
	@echo "Read   $(DEMO)/snake3/derivation.html"
	@echo "Look   $(DEMO)/four_bar.svg"
	@echo "Try    cd $(DEMO) && ../../$(BIN)/python -c 'import four_bar; print(four_bar.__doc__)'"

# Error against run time: quasi-velocities against traditional methods. Interrupted, it goes on where it was.
report: $(VENV)/.test
	$(HAMEL) report models/snake3.yaml models/four_bar.yaml --set tau1=0.01 --set tau2=-0.02 --set base.vx=0.3 --extremes models/extremes -o build/report

test: lint
	$(BIN)/python -m pytest -n auto --dist loadfile -m "not slow"

test-slow: $(VENV)/.test
	$(BIN)/python -m pytest -n auto --dist loadfile --optimised

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

# Types, strict in derive and codegen: two minutes of one core, so continuous integration runs them beside `make test`.
types: $(VENV)/.test
	$(BIN)/pyright

# Import every robot of example-robot-data (431 MB, in an environment of its own) and compare with Pinocchio and MuJoCo.
robots: $(ROBOTS)/.ready
	$(ROBOTS)/bin/python benchmarks/robots.py

# Closed loops and rolling against Exudyn.
loops: $(ROBOTS)/.ready
	$(ROBOTS)/bin/python benchmarks/loops.py

# Derivation, emission, compilation and evaluation of chains and trees of 10 to 1,000 links, beside KanesMethod and Pinocchio.
growth: $(BENCH)/.ready
	$(BENCH)/bin/python benchmarks/growth.py --json build/growth.json --plot build/growth.svg

# Our C beside that of every peer the package indexes carry; the peers are compiled once (minutes) and kept in build/bench.
bench: $(BENCH)/.ready
	$(BENCH)/bin/python benchmarks/bench.py

# Targets on request with every kind of model, each checked by its tool (numba and others in an environment of their own):
# one table, and build/targets.json. Some of them as in make targets TARGETS="casadi cpp".
targets: $(TARGETS_VENV)/.ready
	-@benchmarks/install_target_tools.sh
	$(TARGETS_VENV)/bin/python benchmarks/target_checks.py $(TARGETS)
	$(TARGETS_VENV)/bin/python -m pytest tests/codegen/targets/test_casadi.py tests/codegen/targets/test_cpp.py \
		tests/codegen/targets/test_numba.py tests/codegen/targets/test_jax.py tests/codegen/targets/test_acados.py \
		tests/codegen/targets/test_wasm.py tests/codegen/targets/test_matlab.py tests/codegen/targets/test_cortex_m.py \
		tests/codegen/runtime/test_fmi.py tests/codegen/runtime/test_fmi2.py \
		tests/hamel/build/test_target_pages.py

# What targets cost beside what they stand for, as ratios: FMU, JAX, CasADi, WebAssembly, Cortex-M7; exit 4 where one is above its
# limit. Pinocchio's templates on CasADi's numbers take minutes to compile, once.
target-speed: $(TARGETS_VENV)/.ready $(BENCH)/.ready
	-@benchmarks/install_target_tools.sh
	$(TARGETS_VENV)/bin/python benchmarks/target_speed.py
	$(BENCH)/bin/python benchmarks/panda_targets.py

# Cortex-M4F and M7 in QEMU, from arm-none-eabi-gcc: values, no double, instructions, stack and flash of every kind of model.
embedded: $(TARGETS_VENV)/.ready
	-@benchmarks/install_target_tools.sh
	$(TARGETS_VENV)/bin/python benchmarks/target_checks.py cortex-m

# The table and the plots of docs/bench.md from build/bench.json.
bench-page:
	$(BENCH)/bin/python benchmarks/page.py

# The reference of the model language from the classes that read it.
reference: $(VENV)/.run-time
	$(HAMEL) schema --page > docs/reference/language.md

# Figures and page of models/gallery.
gallery: $(VENV)/.run-time
	$(BIN)/python benchmarks/gallery.py

# The figures of docs/report.md from build/report/report.json and build/whole.json.
report-page: $(VENV)/.test
	$(BIN)/python benchmarks/report_page.py

# Whole simulations to an error of 1e-8 at the end, beside a plain C loop, CasADi's, CVODES, IDAS, SciPy and Exudyn; one motion to
# three errors beside heyoka; and thousands at a time beside heyoka, diffrax, SciPy and MuJoCo: half an hour.
whole: $(BENCH)/.ready
	$(BENCH)/bin/python benchmarks/whole.py
	$(BENCH)/bin/python benchmarks/trajectories.py
	$(BENCH)/bin/python benchmarks/ensembles.py

# How near a sweep comes to the bare lane kernel, what a chunk costs, dask, and motions per second beside joblib and MuJoCo.
sweeps: $(BENCH)/.ready
	$(BENCH)/bin/python benchmarks/sweeps.py --dask --peers --plot docs/sweeps.svg

# A sweep on a dask scheduler of this machine whose workers and scheduler are killed, compared byte by byte with an undisturbed
# one; writes build/cluster.json.
cluster: $(VENV)/.test
	$(BIN)/python benchmarks/cluster.py

# Every verb on the smallest file of everything the schema knows, and random mechanisms (COUNT), from a wheel: two hours of
# two cores; a part of it as in make matrix KINDS="joints mechanisms" COUNT=20. RESUME=1 leaves out what went well before.
matrix: trials
	$(TRIALS)/venv/bin/python tests/trials/matrix.py $(KINDS) $(if $(COUNT),--count $(COUNT)) $(if $(RESUME),--resume)

# Files spoiled, builds killed, many at once, full disks, odd compilers: a right module or a clear refusal, in half an hour;
# a part of it as in make faults KINDS="kills corruptions" COUNT=20.
faults: trials
	$(TRIALS)/venv/bin/python tests/trials/faults.py $(KINDS) $(if $(COUNT),--count $(COUNT)) $(if $(RESUME),--resume)

# Spoiled model and robot files for SECONDS, twenty minutes if not said; what broke before comes first.
fuzz: trials
	$(TRIALS)/venv/bin/python tests/trials/fuzz.py $(KINDS) $(if $(SECONDS),--seconds $(SECONDS)) $(if $(RESUME),--resume)

# The wheel of this checkout in an environment of its own, anew each time.
.PHONY: trials
trials:
	@echo "installing the wheel of hamel into $(TRIALS)/venv"
	@$(PYTHON) tests/trials/environment.py $(TRIALS)

$(BENCH)/.ready: pyproject.toml
	@echo "installing hamel and its peers ($(PEERS)) into $(BENCH)"
	@$(PYTHON) -m venv --clear $(BENCH)
	@$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[cluster]' $(PEERS)
	@touch $@

$(TARGETS_VENV)/.ready: pyproject.toml
	@echo "installing hamel and the tools that check targets into $(TARGETS_VENV)"
	@$(PYTHON) -m venv --clear $(TARGETS_VENV)
	@$(TARGETS_VENV)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[targets]' pytest cmeel-eigen
	@touch $@

$(ROBOTS)/.ready: pyproject.toml
	@echo "installing hamel, Pinocchio, MuJoCo, Exudyn and robots into $(ROBOTS)"
	@$(PYTHON) -m venv --clear $(ROBOTS)
	@$(ROBOTS)/bin/python -m pip install --quiet --disable-pip-version-check --editable . 'pin>=4' example-robot-data 'mujoco>=3' exudyn
	@touch $@

# The documentation site: code of its pages is run, links within it are checked, a warning is an error.
docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -b html -W --keep-going -q -d build/docs/doctrees docs build/docs/site
	@echo "Read   build/docs/site/index.html"

# The links of the site to other places, by the network.
links: $(VENV)/.docs
	$(BIN)/python -m sphinx -b linkcheck -q -d build/docs/doctrees docs build/docs/links

# A book with a chapter for every model of the repository: pages, and a PDF where a Chromium is installed.
book: $(VENV)/.run-time
	$(HAMEL) book models/*.yaml --title "Mechanisms" -o build/book

# Every page of every model and of the gallery in Chromium, at two widths: build/pages.json; a part of it as in make pages MODELS="four_bar bicycle".
pages: $(VENV)/.test
	$(BIN)/python benchmarks/pages.py $(MODELS)

# Live pages of five models in Chromium: size, time to the first picture, work of a frame; build/live.json.
live: $(VENV)/.test
	$(BIN)/python benchmarks/live.py $(MODELS)

# Rebuild the committed modules after a change of the generator.
fresh: $(VENV)/.run-time
	@for name in snake3 four_bar; do $(HAMEL) build models/$$name.yaml -o generated/$$name || exit $$?; done

clean:
	rm -rf build dist .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find derive codegen hamel tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps are older than pyproject.toml when the dependencies may have changed.
$(VENV)/.run-time: pyproject.toml | $(BIN)/pip
	@echo "installing hamel into $(VENV)"
	@$(PIP) --editable .
	@touch $@

$(VENV)/.test: pyproject.toml | $(BIN)/pip
	@echo "installing hamel and its test tools into $(VENV)"
	@$(PIP) --editable '.[test]'
	@touch $@ $(VENV)/.run-time

$(VENV)/.docs: pyproject.toml | $(BIN)/pip
	@echo "installing hamel and what builds its documentation into $(VENV)"
	@$(PIP) --editable '.[docs]'
	@touch $@ $(VENV)/.run-time

$(BIN)/pip:
	@$(PYTHON) -c 'import sys; sys.exit("hamel needs Python 3.11 or newer: make PYTHON=python3.11" if sys.version_info < (3, 11) else 0)'
	@$(PYTHON) -m venv --clear $(VENV)
