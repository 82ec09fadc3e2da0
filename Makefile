# Every target creates .venv where it is missing and installs what it needs; a stamp file per
# set of extras makes the second call free until pyproject.toml or constraints.txt change.
#   PYTHON=python3.12   the interpreter that creates .venv
#   ARGS="..."          extra arguments for the command that the target runs

PYTHON ?= python3
ARGS ?=
BIN := .venv/bin

.DEFAULT_GOAL := help
.PHONY: help train test lint bench throughput budget roofline scaling peers accuracy frames simd-report baselines gallery rllib-smoke clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-11s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# Called again without ARGS, training goes on where it was cut off; a finished run is only evaluated.
RUN := runs/PBDRope-v0-ppo-0
train: .venv/.installed-train ## train PBDRope-v0: model, learning curve and video
	$(BIN)/python train/train.py $(if $(ARGS)$(if $(wildcard $(RUN)/checkpoint.pkl),,new),--env pbd_gym:PBDRope-v0 --video $(ARGS),--resume $(RUN))

# Two processes, each with files of its own: most of the time goes into compiling kernels.
test: .venv/.installed-test ## run the tests
	$(BIN)/python -m pytest -n 2 --dist loadfile $(ARGS)

lint: .venv/.installed-all ## check style, formatting, types, imports and spelling
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/codespell

bench: throughput budget roofline scaling peers ## measure all that the next five do

throughput: .venv/.installed-core ## measure control steps per second
	$(BIN)/python benchmarks/throughput.py $(ARGS)

budget: .venv/.installed-core ## measure where the time of a control step goes
	$(BIN)/python benchmarks/budget.py $(ARGS)

roofline: .venv/.installed-peers ## compare the kernels' speed with C
	$(BIN)/python benchmarks/roofline.py $(ARGS)

scaling: .venv/.installed-peers ## measure cost against particles, worlds and threads
	$(BIN)/python benchmarks/scaling.py $(ARGS)

peers: .venv/.installed-peers ## compare speed with other packages, whichever are installed
	$(BIN)/python benchmarks/peers.py $(ARGS)

accuracy: .venv/.installed-peers ## compare error and cost with other engines
	$(BIN)/python benchmarks/accuracy.py $(ARGS)

frames: .venv/.installed-train ## compare the speed of PPO on our batch and on SB3's own environments
	$(BIN)/python benchmarks/sb3_frames.py $(ARGS)

simd-report: .venv/.installed-core ## tell which kernels are vector code
	$(BIN)/python benchmarks/simd_report.py $(ARGS)

baselines: .venv/.installed-train ## train and compare all policies over 5 seeds: hours, can be stopped and goes on
	$(BIN)/python train/benchmark.py --readme README.md $(ARGS)

gallery: .venv/.installed-video ## draw the README's pictures and every environment in every look
	$(BIN)/python docs/gallery.py $(ARGS)

rllib-smoke: .venv-rllib/.installed ## train on a Ray cluster of two nodes and kill one of them
	.venv-rllib/bin/python tests/rllib_smoke.py

clean: ## remove .venv, caches and build files; results of training stay
	rm -rf .venv .venv-rllib build dist *.egg-info .pytest_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/.installed-core: EXTRAS :=
.venv/.installed-train: EXTRAS := [train,video]
.venv/.installed-video: EXTRAS := [video]
.venv/.installed-test: EXTRAS := [train,video,test]
.venv/.installed-all: EXTRAS := [all]

.venv/.installed-%: pyproject.toml constraints.txt | $(BIN)/pip
	$(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt -e ".$(EXTRAS)"
	@touch $@

# pyPBD brings pygame, which overwrites pygame-ce: it is put back.
.venv/.installed-peers: pyproject.toml constraints.txt | $(BIN)/pip
	$(BIN)/python -m pip install --disable-pip-version-check -c constraints.txt -e ".[peers]"
	$(BIN)/python -m pip uninstall -y pygame
	$(BIN)/python -m pip install --force-reinstall --no-deps -c constraints.txt pygame-ce
	@touch $@

# pip is the last thing that venv writes, so a half-made .venv is not taken for a whole one.
$(BIN)/pip:
	$(PYTHON) -m venv .venv

# Ray pins one Gymnasium, older than the one in constraints.txt.
.venv-rllib/.installed: pyproject.toml constraints-rllib.txt | .venv-rllib/bin/pip
	.venv-rllib/bin/python -m pip install --disable-pip-version-check -c constraints-rllib.txt -e ".[rllib]"
	@touch $@

.venv-rllib/bin/pip:
	$(PYTHON) -m venv .venv-rllib
