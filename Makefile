# `make` sets everything up and builds the embedded subject; `make test` sets everything up and tests.
PYTHON ?= python3
BIN := .venv/bin
# gmsh's library links against these even where it draws nothing
GMSH_LIBRARIES := libglu1-mesa libgl1 libxrender1 libxcursor1 libxfixes3 libxext6 libxft2 libxinerama1 libx11-6 libfontconfig1

.DEFAULT_GOAL := all
.PHONY: all setup test lint format rulegraph clean

all: setup
	$(BIN)/snakemake -j2 all

setup: .venv/installed

.venv/installed: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "handpipe needs Python 3.11 or newer: make PYTHON=/path/to/python3"; exit 1; }
	@[ -x $(BIN)/python ] || $(PYTHON) -m venv .venv 2>/dev/null || { rm -rf .venv; \
	  $(call system_packages,python3-venv) && $(PYTHON) -m venv .venv; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@$(BIN)/python -c 'import gmsh' 2>/dev/null || { $(call system_packages,$(GMSH_LIBRARIES)); }
	@$(BIN)/python -c 'import gmsh'
	@touch $@

# Install Debian packages where this user may, else say what to install.
define system_packages
if [ "$$(id -u)" = 0 ]; then apt-get update -qq && apt-get install -y -qq --no-install-recommends $(1) >/dev/null; \
elif sudo -n true 2>/dev/null; then sudo apt-get update -qq && sudo apt-get install -y -qq --no-install-recommends $(1) >/dev/null; \
else echo "Please run once: sudo apt-get install $(1)"; exit 1; fi
endef

test: setup
	$(BIN)/python -m pytest

lint: setup
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy
	$(BIN)/snakefmt --check Snakefile workflow/rules && $(BIN)/snakemake --lint

format: setup
	$(BIN)/ruff check --fix . && $(BIN)/ruff format . && $(BIN)/snakefmt Snakefile workflow/rules

rulegraph: setup
	mkdir -p results
	$(BIN)/snakemake --rulegraph mermaid-js all > results/rulegraph.mmd
	@echo "results/rulegraph.mmd: paste it into any Mermaid viewer"

clean:
	rm -rf results .snakemake
