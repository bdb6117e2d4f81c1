# A fresh clone needs make and Python 3.11 or newer with its venv module; every target sets up the rest by itself.
PYTHON ?= python3
ARGS ?=
BIN := .venv/bin

.DEFAULT_GOAL := help
.PHONY: help study demo walker2d zoo test bench clean
.DELETE_ON_ERROR:

# A stamp says that .venv holds these dependencies. Each set contains the ones before it, so its recipe writes
# their stamps too: `make study` after `make test` installs nothing.
CORE := .venv/core.stamp
DEV := .venv/dev.stamp
BENCH := .venv/bench.stamp
INPUTS := pyproject.toml constraints.txt

# $(call install,EXTRAS,ABOUT HOW LONG,STAMPS)
define install
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "coachable needs Python 3.11 or newer; \`$(PYTHON) --version\` says: $$($(PYTHON) --version 2>&1 | head -n 1)." \
	       "Name another one: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "$(PYTHON) has no venv module. On Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@echo "Setting up .venv with coachable$(1) (about $(2))…"
	@test -x $(BIN)/pip || $(PYTHON) -m venv .venv
	@$(BIN)/pip install --quiet --disable-pip-version-check --no-input -e '.$(1)' -c constraints.txt \
	  >.venv/setup.log 2>&1 </dev/null || { cat .venv/setup.log >&2; \
	  echo "Setting up failed; pip's own words are above. The same command tries again; make clean starts afresh." >&2; exit 1; }
	@touch $(3)
endef

help:
	@echo "make study   the paper's whole study into runs/paper; ARGS='--semantics released-code --out runs/released'"
	@echo "make demo    one setup, a few seeds, under two minutes, into runs/demo"
	@echo "make walker2d  MuJoCo's Walker2d told to walk and to hop, with stable-baselines3: hours, and resumable"
	@echo "make zoo     robots told to walk, run, hop, trot, …, twenty seeds each: hours, and resumable; ARMS='walker2d-walk' for some"
	@echo "make test    lint, types and the whole test suite; ARGS='tests/plants -k energy' for a part"
	@echo "make bench   how fast it is, beside SciPy, stable-baselines3, sbx, rtamt and others; wants an idle machine"
	@echo "make clean   remove .venv and the tools' caches; runs/ stays"

study: $(CORE)
	@$(BIN)/coachable train paper $(call out,runs/paper) $(ARGS)

demo: $(CORE)
	@$(BIN)/coachable train demo $(call out,runs/demo) $(ARGS)

walker2d: $(DEV)
	@for run in walk hop hop-described; do \
	  $(BIN)/coachable train experiments/walker2d/$$run.toml --out runs/walker2d-$$run $(ARGS) && \
	  $(BIN)/coachable gait runs/walker2d-$$run || exit; \
	done

ARMS ?= $(sort $(basename $(notdir $(wildcard experiments/zoo/*.toml))))

zoo: $(DEV)
	@for arm in $(ARMS); do \
	  $(BIN)/coachable train experiments/zoo/$$arm.toml --out runs/zoo/$$arm $(ARGS) && \
	  $(BIN)/coachable gait runs/zoo/$$arm || exit; \
	done

# The default folder, unless ARGS names one.
out = $(if $(filter -o --out --out=%,$(ARGS)),,--out $(1))

test: $(DEV)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright
	$(BIN)/pytest -n 2 --dist loadfile $(ARGS)

bench: $(BENCH)
	@$(BIN)/python -m bench $(ARGS)

clean:
	rm -rf .venv .pytest_cache .ruff_cache .hypothesis

$(CORE): $(INPUTS)
	$(call install,,a minute,$(CORE))

$(DEV): $(INPUTS)
	$(call install,[dev],three minutes,$(CORE) $(DEV))

$(BENCH): $(INPUTS)
	$(call install,[bench],four minutes,$(CORE) $(DEV) $(BENCH))
