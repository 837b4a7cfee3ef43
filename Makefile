# `make` sets everything up and builds the embedded subject, a whole hand, `make finger` one finger; `make test` sets
# everything up and tests.
PYTHON ?= python3
BIN := .venv/bin
# What a minimal Debian lacks: the module venv; libraries of OpenMP, and of X11 and OpenGL, against which gmsh links
# even where it draws nothing; EGL, by which VTK draws. The two lists stand side by side.
LIBRARIES := libgomp.so.1 libGLU.so.1 libGL.so.1 libXrender.so.1 libXcursor.so.1 libXfixes.so.3 libXext.so.6 \
  libXft.so.2 libXinerama.so.1 libX11.so.6 libfontconfig.so.1 libEGL.so.1
PACKAGES = $(VENV_PACKAGE) libgomp1 libglu1-mesa libgl1 libxrender1 libxcursor1 libxfixes3 libxext6 \
  libxft2 libxinerama1 libx11-6 libfontconfig1 libegl1
VENV_PACKAGE = $(shell $(PYTHON) -c 'import importlib.util, sys; \
  importlib.util.find_spec("ensurepip") or print("python%d.%d-venv" % sys.version_info[:2])')

.DEFAULT_GOAL := all
.PHONY: all finger setup test test-all coverage lint format docs rulegraph benchmark benchmark-setup clean

all: setup
	$(BIN)/snakemake -j2 all

finger: setup
	$(BIN)/snakemake -j2 all --configfile config/finger.yaml

setup: .venv/installed

.venv/installed: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "handpipe needs Python 3.11 or newer: make PYTHON=/path/to/python3"; exit 1; }
	@$(call system_complete) || { $(call install_packages); }
	@[ -x $(BIN)/pip ] || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@$(BIN)/python -c 'import gmsh'
	@touch $@

# Whether the interpreter can make environments and, on Linux, every library is found.
define system_complete
$(PYTHON) -c 'import ctypes, ensurepip, sys; sys.platform != "linux" or [ctypes.CDLL(n) for n in sys.argv[1:]]' \
  $(LIBRARIES) 2>/dev/null
endef

# Install Debian packages where this user may, else say what to install: all that is needed, once.
APT_INSTALL := env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends
define install_packages
if ! command -v apt-get >/dev/null; then \
  echo "handpipe needs libraries that this system lacks; of these, what is not there: $(LIBRARIES)"; exit 1; \
elif [ "$$(id -u)" = 0 ]; then apt-get update -qq && $(APT_INSTALL) $(PACKAGES) >/dev/null; \
elif sudo -n true 2>/dev/null; then sudo apt-get update -qq && sudo $(APT_INSTALL) $(PACKAGES) >/dev/null; \
else echo "handpipe needs packages that are not installed, and this user may not install them."; \
  echo "Run as root, once, then make again:"; \
  echo "  apt-get update && apt-get install -y --no-install-recommends $(PACKAGES)"; exit 1; fi
endef

# Test files side by side, one thread each: one process more than there are cores, since tests wait for workflows and
# browsers, but at most four, so that memory suffices.
PYTEST := env OMP_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1 \
  $(BIN)/python -m pytest -n $(shell $(PYTHON) -c 'import os; print(min(os.cpu_count() + 1, 4))') \
  --dist loadfile --no-loadscope-reorder

test: setup
	$(PYTEST)

# Those marked as slow, too: before a release, and after changes of rules, levels or images.
test-all: setup
	$(PYTEST) -m "slow or not slow"

# All tests with the share of lines and branches of src that they reach: below the least share of pyproject.toml it
# fails. Jobs that Snakemake starts are not counted. With it tests take 1.5 times as long.
coverage: setup
	$(PYTEST) -m "slow or not slow" --cov --cov-report=term

lint: setup
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy
	$(BIN)/snakefmt --check Snakefile workflow/helpers workflow/rules && $(BIN)/snakemake --lint

format: setup
	$(BIN)/ruff check --fix . && $(BIN)/ruff format . && $(BIN)/snakefmt Snakefile workflow/helpers workflow/rules

rulegraph: setup
	mkdir -p results
	$(BIN)/snakemake --rulegraph mermaid-js all > results/rulegraph.mmd
	@echo "results/rulegraph.mmd: paste it into any Mermaid viewer"

# The site: site/index.html. A broken link or an unknown reference fails it.
docs: requirements-docs.lock
	@[ -x .venv-docs/bin/pip ] || $(PYTHON) -m venv .venv-docs
	.venv-docs/bin/python -m pip install --quiet --disable-pip-version-check -r requirements-docs.lock
	NO_MKDOCS_2_WARNING=1 .venv-docs/bin/mkdocs build --strict

# What the benchmarks compare with; without it those figures are left out.
benchmark-setup: setup requirements-benchmark.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -r requirements-benchmark.lock

benchmark: benchmark-setup
	$(BIN)/snakemake -j1 benchmark_fem

clean:
	rm -rf results .snakemake site
