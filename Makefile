# The two commands: `make demo` and `make test`. On a bare Debian 12 machine, as root or with sudo, each installs
# what is missing, builds, and runs; the second time they only run.
#
#   make env           Debian packages, .venv, build: after it there is .venv/bin/latinpc
#   make build         compile what has changed
#   make demo          the tensegrity grid of 144 subdomains: summary, picture and VTU in demo/
#   make test          the quick tests; `make test-all` adds the slow ones
#   make test PETSC=latest|debug|int64|single   the same with the newest PETSC instead of Debian's: built once, and kept
#   make test SANITIZE=1   the same with AddressSanitizer and UBSan in our library
#   make test VALGRIND=1   the same under valgrind, which takes hours: VALGRIND=first runs one case of each test, and
#                      PYTEST_ARGS=tests/test_snes.py those of a file
#   make coverage      the quick tests; which lines of C and Python they run, in build/coverage
#   make docs          the site of the documentation, in build/docs/html; any warning is an error
#   make bench         the benchmarks, their tables and figures; BENCH=full adds the large ones
#   make format-check  clang-format and ruff, as CI runs them; `make format` applies them
#   make lint          ruff's rules, and the order of folders (.ci/floors.py)
#   make clean         remove what was built; `make distclean` removes .venv* too

SHELL       := /bin/bash
PYTHON      ?= /usr/bin/python3
PYTEST_ARGS ?= $(if $(filter single,$(PETSC)),$(SINGLE))
# most tests hold results against references to ten digits: in single precision there are these
SINGLE      := $(addprefix tests/test_,single.py doors.py which_petsc.py)
# files of tests are shared out to two processes: tests of several ranks fill more cores by themselves
PARALLEL    ?= -n 2 --dist loadfile
PETSC       ?= debian
PACKAGES    := petsc-dev python3-petsc4py python3-mpi4py python3-numpy python3-scipy python3-venv python3-dev \
               python3-slepc4py libslepc-real-dev \
               libmetis-dev cython3 cmake ninja-build gcc libc6-dev pkg-config openmpi-bin libopenblas0-serial

ifeq ($(filter $(PETSC),debian latest debug int64 single),)
$(error PETSC=$(PETSC): it is debian, latest, debug, int64 or single)
endif
# The libraries of other kinds are installed into a virtual environment of their own, not beside the sources; the PETSc
# that they need is kept outside the tree, for the next clone
KIND    := $(PETSC)$(if $(SANITIZE),-sanitize)$(if $(VALGRIND),-valgrind)$(if $(COVERAGE),-coverage)
VENV    := .venv$(patsubst %,-%,$(filter-out debian,$(KIND)))
BUILD   := build/$(patsubst debian,make,$(KIND))
ifneq ($(PETSC),debian)
PACKAGES += g++ gfortran libblas-dev liblapack-dev libscalapack-mpi-dev libmumps-dev libsuitesparse-dev \
            libptscotch-dev libhdf5-mpi-dev
PETSC_PREFIX := $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/latinpc/petsc-$(shell sed -n 's/^ *"petsc==\(.*\)",/\1/p' pyproject.toml)-$(PETSC)
endif
ifneq ($(SANITIZE),)
# Python, MPI and PETSc keep memory to the end, so that lists of leaks are left to PETSC=debug; an allocation beyond the
# limit of memory fails as it does without AddressSanitizer
PYTEST_ENV  = env LD_PRELOAD=$$(gcc -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1 \
              UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
# a report ends the process: it goes to the terminal, not to a file of pytest's that ends with it
PYTEST_KIND = --capture=sys
endif
ifneq ($(VALGRIND),)
PACKAGES += valgrind
VALGRIND_LOGS = $(abspath $(BUILD))/logs
# compilers and Open MPI's daemon are left alone; mpirun is not, or its ranks would be, too. Long stacks lead from
# libraries of PETSc's back to the lines of ours that have called them
PYTEST_ENV  = rm -rf $(VALGRIND_LOGS); mkdir -p $(VALGRIND_LOGS); \
              env VALGRIND_LOGS=$(VALGRIND_LOGS) HWLOC_COMPONENTS=-x86 LATINPC_EXAMPLES=3 \
              valgrind -q --trace-children=yes --trace-children-skip='*/mpicc,*/mpif90,*/pkg-config,*/orted' \
              --num-callers=30 --fullpath-after= --keep-debuginfo=yes --leak-check=full --show-leak-kinds=definite \
              --suppressions=$(abspath tests/valgrind.supp) --log-file=%q{VALGRIND_LOGS}/%p.log
PYTEST_KIND = --timeout=18000
PYTEST_THEN = ; code=$$?; $(BIN)/python tests/valgrind_reports.py $(VALGRIND_LOGS) && exit $$code
endif
BIN     := $(VENV)/bin
extra    = $(shell $(BIN)/python -c "import tomllib; \
             print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['$(1)'])")
# what .ci/floors.py checks: c, python
FLOORS  := c python
C_FILES := $(wildcard latinpc/src/*.[ch] latinpc/src/*/*.[ch] latinpc/include/*.h tests/*.c examples/*.c)

# Debian's petsc4py goes with Debian's PETSc, whatever else the shell points to
unexport PETSC_DIR PETSC_ARCH PYTHONPATH PYTHONHOME PETSC_OPTIONS

# Containers run as root, and tests use more ranks than cores; one thread a rank keeps comparisons honest
export OMPI_ALLOW_RUN_AS_ROOT             := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM     := 1
export OMPI_MCA_rmaps_base_oversubscribe  := 1
export OMPI_MCA_hwloc_base_binding_policy := none
# ranks that wait let others work: programs of several ranks run side by side
export OMPI_MCA_mpi_yield_when_idle       := 1
export OMP_NUM_THREADS                    := 1
export OPENBLAS_NUM_THREADS               := 1

.PHONY: env build demo test test-all coverage docs bench format format-check lint clean distclean
.DEFAULT_GOAL := env
# the stamps are made one after the other
.NOTPARALLEL:

env: build

$(VENV)/.system: Makefile
	@missing=; \
	if command -v dpkg-query >/dev/null; then \
	  for p in $(PACKAGES); do \
	    [ "$$(dpkg-query -W -f='$${db:Status-Status}' $$p 2>/dev/null)" = installed ] || missing="$$missing $$p"; \
	  done; \
	else \
	  echo "This is not a Debian system: going on with the packages that are here."; \
	fi; \
	if [ -n "$$missing" ]; then \
	  echo "Installing Debian packages:$$missing"; \
	  [ "$$(id -u)" = 0 ] && sudo= || sudo=sudo; \
	  install="$$sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -q -o DPkg::Lock::Timeout=600 --no-install-recommends $$missing"; \
	  $$install >/dev/null 2>&1 </dev/null || { $$sudo apt-get update -q </dev/null && $$install </dev/null; }; \
	fi
	@[ -e $(BIN)/python ] || $(PYTHON) -m venv --system-site-packages $(VENV)
	@touch $@

$(VENV)/.dev: $(VENV)/.system pyproject.toml
	@echo "Installing the Python tools pinned in pyproject.toml"
	@$(BIN)/python -m pip install -q --disable-pip-version-check $(call extra,dev)
	@touch $@

ifeq ($(KIND),debian)
$(VENV)/.tools: $(VENV)/.dev
	@LATINPC_INPLACE=true $(BIN)/python -m pip install -q --disable-pip-version-check --no-build-isolation --no-deps -e .
	@touch $@

$(BUILD)/build.ninja: latinpc/CMakeLists.txt $(VENV)/.tools
	@cmake -S latinpc -B $(BUILD) -G Ninja -DLATINPC_INPLACE=ON -DLATINPC_WERROR=ON \
	  -DPython_EXECUTABLE=$(abspath $(BIN)/python) --log-level=WARNING
	@touch $@

build: $(BUILD)/build.ninja
	@flock $(VENV)/.lock cmake --build $(BUILD)
else
$(VENV)/.tools: $(VENV)/.dev .ci/petsc
ifneq ($(PETSC),debian)
	@$(BIN)/python -m pip install -q --disable-pip-version-check $(filter-out petsc==% petsc4py==% slepc==% slepc4py==%,$(call extra,petsc))
	@.ci/petsc $(PETSC) $(PETSC_PREFIX) $(abspath $(BIN)/python)
	@$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps --force-reinstall $(PETSC_PREFIX)/wheels/*.whl
endif
	@touch $@

build: $(VENV)/.tools
	@$(BIN)/python -m pip install -q --disable-pip-version-check --no-build-isolation --no-deps --force-reinstall . \
	  --config-settings=build-dir=$(BUILD) $(if $(VALGRIND),--config-settings=install.strip=false) --config-settings=cmake.define.LATINPC_$(or $(if $(SANITIZE),SANITIZE),$(if $(VALGRIND),VALGRIND),$(if $(COVERAGE),COVERAGE),WERROR)=ON
endif

demo: env
	@mkdir -p demo
	$(BIN)/latinpc solve tensegrity-grid --modules 48 --subdomains 144 \
	  --output demo/tensegrity-grid.vtu --picture demo/tensegrity-grid.png --json demo/tensegrity-grid.json

test: env
	$(PYTEST_ENV) $(BIN)/pytest $(PYTEST_KIND) -m "not slow" $(PARALLEL) $(PYTEST_ARGS) $(PYTEST_THEN)

test-all: env
	$(PYTEST_ENV) $(BIN)/pytest $(PYTEST_KIND) $(PARALLEL) $(PYTEST_ARGS) $(PYTEST_THEN)

ifeq ($(COVERAGE),)
coverage:
	@$(MAKE) --no-print-directory coverage COVERAGE=1
else
# one process: a worker of pytest-xdist that takes long to end is killed, and its counts of C lines are lost
coverage: PARALLEL :=
coverage: env
	@$(BIN)/python -m pip install -q --disable-pip-version-check $(call extra,coverage)
	@find $(BUILD) -name "*.gcda" -delete; rm -f .coverage .coverage.*; mkdir -p build/coverage
	-$(BIN)/coverage run $(BIN)/pytest -m "not slow" $(PARALLEL) $(PYTEST_ARGS)
	@$(BIN)/coverage combine -q; $(BIN)/coverage html -q -d build/coverage/python; $(BIN)/coverage report --skip-covered
	@$(BIN)/gcovr --root . --gcov-ignore-parse-errors=suspicious_hits.warn_once_per_file --filter latinpc/src --txt --html-details build/coverage/c.html $(BUILD)
endif

$(VENV)/.docs: $(VENV)/.tools
	@echo "Installing Sphinx and what notebooks need, pinned in pyproject.toml"
	@$(BIN)/python -m pip install -q --disable-pip-version-check $(call extra,docs)
	@touch $@

docs: env $(VENV)/.docs
	$(BIN)/sphinx-build -c docs -b html -E -W --keep-going -q . build/docs/html
	@echo "build/docs/html/index.html"

$(VENV)/.bench: $(VENV)/.tools
	@echo "Installing another interior point method pinned in pyproject.toml"
	@$(BIN)/python -m pip install -q --disable-pip-version-check $(call extra,bench)
	@touch $@

bench: env $(VENV)/.bench
	$(BIN)/python benchmarks/run.py $(if $(filter full,$(BENCH)),--full)
	$(if $(filter full,$(BENCH)),$(BIN)/python benchmarks/directions.py && $(BIN)/python benchmarks/iteration.py)
	$(BIN)/python benchmarks/plot.py

format: env
	$(BIN)/clang-format -i $(C_FILES)
	$(BIN)/ruff format
	$(BIN)/ruff check --fix

format-check: env
	$(BIN)/clang-format --dry-run -Werror $(C_FILES)
	$(BIN)/ruff format --check

lint: env
	$(BIN)/ruff check
	$(BIN)/python .ci/floors.py $(FLOORS)

clean:
	rm -rf build demo latinpc/*.so .pytest_cache .ruff_cache .hypothesis docs/tutorial/*.png docs/tutorial/*.gif
	find latinpc tests examples -name __pycache__ -prune -exec rm -rf {} +

distclean: clean
	rm -rf .venv .venv-*
