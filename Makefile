# Frazil on one machine: set up, build, render, test. `make help` lists the targets.
# A bare Debian 12 or Ubuntu 22.04 / 24.04 is enough; every step is skipped where nothing has changed.

VENV       ?= .venv
BUILD      ?= build/venv
JOBS       ?= $(shell nproc)
RESOLUTION ?= 960x540
SAMPLES    ?= 32
# Of the example's meshes: finer above 1. A scene that is there already for this detail is left as it is.
DETAIL     ?= 0.75
SECONDS    ?= 60
# Of the pictures of `make figures`.
FIGURE_RESOLUTION ?= 320x180
FIGURE_SAMPLES    ?= 12
# For `make bench`: --full for large sizes.
BENCH ?=
OUT        ?= out

STAMPS := $(VENV)/stamps
BIN    := $(VENV)/bin
# Tools of the virtual environment first; nothing outside it may stand in for the package under test.
export PATH := $(abspath $(BIN)):$(PATH)
unexport PYTHONPATH PYTHONHOME
export CMAKE_BUILD_PARALLEL_LEVEL ?= $(JOBS)
ifneq ($(shell command -v ccache 2>/dev/null),)
export CMAKE_CXX_COMPILER_LAUNCHER ?= ccache
endif

CORE_SOURCES   := $(shell find src -name '*.cpp' -o -name '*.h')
PYTHON_SOURCES := $(shell find python -name '*.py' -o -name '*.pyi' -o -name 'py.typed' -o -name '*.mtlx')
# Folders, so that a file that was removed is seen too.
SOURCE_FOLDERS := $(shell find src python -type d -not -name __pycache__)
CPP_TESTS      := $(shell find tests/cpp -name '*.cpp' -o -name '*.h') tests/cpp
PIP_INSTALL    := pip install -q --disable-pip-version-check
CMAKE_CONFIG   := -C build-dir=$(BUILD) -C cmake.define.FRAZIL_BUILD_TESTS=ON

.DEFAULT_GOAL := help
.PHONY: help setup build render figures bench test quick test-cpp sanitize fuzz docs lint format stubs wheel check-wheel \
        clean distclean
.DELETE_ON_ERROR:

help: ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{printf "%-20s %s\n", $$1, $$2}'
	@echo
	@echo "  Variables: RESOLUTION=$(RESOLUTION) SAMPLES=$(SAMPLES) DETAIL=$(DETAIL) SECONDS=$(SECONDS) OUT=$(OUT) JOBS=$(JOBS) VENV=$(VENV)"

# ---- set-up ---------------------------------------------------------------------------------------------------------

$(STAMPS)/venv: scripts/setup.sh
	@scripts/setup.sh packages
	@scripts/setup.sh venv $(VENV)
	@mkdir -p $(STAMPS) && touch $@

$(STAMPS)/runtime: $(STAMPS)/venv pyproject.toml scripts/requirements.py
	@echo "setup: Python packages to build and run"
	@scripts/setup.sh python $(VENV) build runtime
	@touch $@

$(STAMPS)/test: $(STAMPS)/runtime
	@echo "setup: Python packages to test"
	@scripts/setup.sh python $(VENV) test
	@touch $@

$(STAMPS)/denoise: $(STAMPS)/runtime pyproject.toml
	@echo "setup: the denoiser"
	@scripts/setup.sh python $(VENV) denoise
	@touch $@

$(STAMPS)/docs: $(STAMPS)/venv pyproject.toml
	@echo "setup: Python packages for the documentation's site"
	@scripts/setup.sh python $(VENV) docs
	@touch $@

setup: $(STAMPS)/runtime ## Install what is missing: Debian packages, .venv, Python packages

# ---- build ----------------------------------------------------------------------------------------------------------

# pip rebuilds in $(BUILD), so only what has changed is compiled.
$(STAMPS)/package: $(STAMPS)/runtime $(CORE_SOURCES) $(PYTHON_SOURCES) $(SOURCE_FOLDERS) CMakeLists.txt README.md LICENSE
	@echo "build: the package, into $(VENV)"
	@$(PIP_INSTALL) --no-build-isolation --no-deps --force-reinstall $(CMAKE_CONFIG) .
	@touch $@

# The tests link the core that the package has just compiled.
$(STAMPS)/cpp_tests: $(STAMPS)/package $(CPP_TESTS)
	@echo "build: the C++ tests"
	@cmake --build $(BUILD) --target frazil_tests
	@touch $@

build: $(STAMPS)/package ## Build and install the package into .venv

# ---- render ---------------------------------------------------------------------------------------------------------

render: $(STAMPS)/package $(STAMPS)/denoise ## Render the example scene: RESOLUTION=960x540 SAMPLES=32
	@mkdir -p $(OUT)
	@python examples/glacier.py -o $(OUT)/glacier.usda --detail $(DETAIL)
	@frazil render $(OUT)/glacier.usda -o $(OUT)/glacier.exr --resolution $(RESOLUTION) --samples $(SAMPLES) --denoise

figures: $(STAMPS)/package $(STAMPS)/denoise ## Render the talk's figures anew into docs/images: FIGURE_RESOLUTION=320x180
	@$(PIP_INSTALL) matplotlib Pillow
	@python examples/figures.py -o docs/images --work $(OUT)/figures --resolution $(FIGURE_RESOLUTION) --samples $(FIGURE_SAMPLES)

bench: $(STAMPS)/package ## Race against the peers, one table in bench/results: BENCH=--full for large sizes
	@$(PIP_INSTALL) matplotlib Pillow
	@python bench/all.py $(BENCH)

# ---- test -----------------------------------------------------------------------------------------------------------

test-cpp: $(STAMPS)/cpp_tests ## Run the C++ tests
	@ctest --test-dir $(BUILD) --output-on-failure

test: test-cpp $(STAMPS)/test ## Run all tests: C++, then Python
	@pytest

quick: test-cpp $(STAMPS)/test ## Run all tests but the slow ones
	@pytest -m "not slow"

# Left out under sanitizers: cases of many samples, which run the code of others for long.
LONG_CASES := white furnace*,furnace*,density: the core*,of three bodies*,a sphere cut into two*,*of a set*,microfacet albedo*

sanitize: $(STAMPS)/runtime ## Run the C++ tests under AddressSanitizer and UBSan
	@cmake -S . -B build/sanitize -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -g1" \
	    -DFRAZIL_BUILD_TESTS=ON -DFRAZIL_SANITIZE=ON
	@cmake --build build/sanitize --target frazil_tests
	@# In two processes, half of the cases each: most of them use one core.
	@export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1; tests="build/sanitize/frazil_tests"; \
	half=$$(( ($$($$tests -c -tce='$(LONG_CASES)' | grep -o '[0-9]*$$') + 1) / 2 )); \
	$$tests -tce='$(LONG_CASES)' --last=$$half & first=$$!; failed=0; \
	$$tests -tce='$(LONG_CASES)' --first=$$((half + 1)) || failed=1; \
	wait $$first || failed=1; exit $$failed

fuzz: $(STAMPS)/test ## Fuzz every reader: SECONDS=60 for each of them
	@python tests/fuzz/fuzz.py --seconds $(SECONDS)

docs: $(STAMPS)/docs ## Build the documentation's site into out/site; a broken link is an error
	@NO_MKDOCS_2_WARNING=1 mkdocs build --strict --quiet

FORMATTED := src tests/cpp

lint: $(STAMPS)/test ## Check the format and the rules of C++ and Python
	@find $(FORMATTED) -name '*.cpp' -o -name '*.h' | xargs clang-format --dry-run --Werror
	@ruff check .
	@ruff format --check .

format: $(STAMPS)/test ## Bring C++ and Python into format
	@find $(FORMATTED) -name '*.cpp' -o -name '*.h' | xargs clang-format -i
	@ruff check --fix -q . ; ruff format -q .

stubs: $(STAMPS)/package ## Write python/frazil/_frazil.pyi from the built module
	@python -m nanobind.stubgen -q -m frazil._frazil -o python/frazil/_frazil.pyi

# ---- distribution ---------------------------------------------------------------------------------------------------

wheel: $(STAMPS)/test ## Make a self-contained wheel in dist/
	@scripts/make_wheel.sh $(BUILD) dist

check-wheel: wheel ## Install the wheel in a fresh environment and render without Embree and TBB packages
	@scripts/check_wheel.sh dist

clean: ## Remove builds and pictures, keep the virtual environment
	@rm -rf build dist $(OUT) $(STAMPS)/package $(STAMPS)/cpp_tests

distclean: clean ## Remove the virtual environment too
	@rm -rf $(VENV)
