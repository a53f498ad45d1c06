# make demo | test are all that a newcomer needs; each installs what is missing first.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.ONESHELL:
.DEFAULT_GOAL := help

CARGO ?= cargo
TARGET := $(or $(CARGO_TARGET_DIR),target)
GRASSFIRE := $(TARGET)/release/grassfire
DEMO_OUT ?= out/wishbone
CORPUS ?= $(or $(GRASSFIRE_CORPUS),../shared/data)

.PHONY: help setup build demo test bench corpus outside-check

help: ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 20

setup: ## install what is missing (Rust, compiler, OpenCASCADE), nothing else
	@tools/setup.sh

build: setup ## target/release/grassfire
	@. tools/env.sh
	$(CARGO) build --release --locked -p grassfire-cli

demo: build ## optimize, reconstruct and verify a wishbone: STEP and report in out/wishbone
	@code=0
	$(GRASSFIRE) demo wishbone -o $(DEMO_OUT) || code=$$?
	if [ $$code -le 1 ]; then
	  echo
	  echo "STEP    $(DEMO_OUT)/part.step"
	  echo "report  $(DEMO_OUT)/report.html"
	fi
	exit $$code

test: ## format, lints, all tests (with the corpus where it is), checks of the demo's STEP by other programs
	@tools/setup.sh test
	tools/test.sh

bench: setup ## speed beside others: medial stage and CGAL (installs libcgal-dev), optimizer and pyMOTO, quads and Instant Meshes and QuadriFlow (from PyPI); of the faces
	@. tools/env.sh
	grassfire/benches/cgal/run.sh
	grassfire/benches/topopt/run.sh
	grassfire/benches/peers/run.sh
	$(CARGO) bench --locked -p grassfire --no-default-features --bench spline

corpus: build ## the real and the bad parts of $(CORPUS)
	@. tools/env.sh
	if [ ! -d "$(CORPUS)" ]; then echo "no corpus in $(CORPUS): set GRASSFIRE_CORPUS to its folder" >&2; exit 2; fi
	GRASSFIRE_CORPUS="$$(realpath "$(CORPUS)")" $(CARGO) test --release --locked -p grassfire -p grassfire-cli -- --include-ignored
