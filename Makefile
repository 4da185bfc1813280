# Two commands matter: `make demo` shows it, `make test` proves it. Both do all the set-up they need.
.PHONY: help demo test quick setup browser page linked lint docs wheels clean
PYTHON ?=
OUT ?= out/demo
SEED ?=

help:
	@echo 'make demo    seed -> furnished house -> panoramas -> an agent finds something -> Rerun recording, in $(OUT)'
	@echo 'make test    the whole test suite'
	@echo 'make setup   only the set-up: system packages, .venv, Python packages'
	@echo 'make quick   the tests that take less than a minute together'
	@echo 'make lint    ruff, its formatter, names and docstrings, import-linter, mypy'
	@echo 'make docs    the documentation site, in site/; warnings are errors'
	@echo 'make browser install Chromium and Caddy (Debian), without which the tests of `embodied serve` in them are skipped'
	@echo 'make page    build the page of `embodied serve` from web/ with Node'
	@echo 'make wheels  build embodied-houses and embodied-houses-furniture into dist/'

setup:
	@PYTHON='$(PYTHON)' ./setup.sh

demo: setup
	@.venv/bin/embodied demo --out '$(OUT)' $(if $(SEED),--seed $(SEED))

test: setup
	@OMP_NUM_THREADS=1 .venv/bin/python -m pytest -q -n 2 --dist worksteal

# one package in one folder, as a wheel installs it, for tools that read sources
linked:
	@mkdir -p build/linked/embodied; find build/linked -xtype l -delete
	@ln -sfn $(CURDIR)/embodied/* $(CURDIR)/agents $(CURDIR)/assets $(CURDIR)/viz build/linked/embodied/

lint: setup linked
	@.venv/bin/ruff check .
	@.venv/bin/ruff format --check .
	@.venv/bin/python packaging/lint_words.py
	@(cd build/linked && ../../.venv/bin/lint-imports --config ../../pyproject.toml --no-cache) > build/imports.log 2>&1 \
	  || { cat build/imports.log; false; }
	@.venv/bin/mypy

quick: setup
	@OMP_NUM_THREADS=1 .venv/bin/python -m pytest -q -m 'not slow' -n 2 --dist worksteal

docs: setup linked
	@.venv/bin/python docs/build_results.py
	@.venv/bin/python docs/build_reference.py
	@NO_MKDOCS_2_WARNING=1 .venv/bin/mkdocs build --strict -q

browser:
	@command -v chromium >/dev/null && command -v caddy >/dev/null || { as=$$([ "$$(id -u)" = 0 ] || echo 'sudo -n'); \
	  get="$$as env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium caddy fonts-dejavu-core"; \
	  $$get >/dev/null 2>&1 || { $$as apt-get update -qq && $$get >/dev/null; }; } \
	  || echo 'note: no Chromium or Caddy here; their tests are skipped'

page:
	@cd web && npm ci --no-audit --no-fund && npm run build

wheels: setup
	@.venv/bin/python packaging/furniture/collect.py
	@.venv/bin/python -m pip wheel -q --no-deps -w dist . ./packaging/furniture
	@.venv/bin/python -c 'import twine' 2>/dev/null || .venv/bin/python -m pip install -q -c constraints.txt twine
	@.venv/bin/twine check --strict dist/*.whl

clean:
	rm -rf .venv build dist out site docs/results/details.md docs/reference/command_line.md *.egg-info
