# make demo | make test | make lint | make bench; everything lives in .venv
PYTHON ?= python3
VENV ?= .venv
RUN = $(VENV)/bin/python

$(VENV)/.ready: pyproject.toml scripts/setup.sh
	PYTHON=$(PYTHON) sh scripts/setup.sh $(VENV)
	touch $@

test: $(VENV)/.ready
	$(RUN) -m pytest

lint: $(VENV)/.ready
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .

clean:
	rm -rf $(VENV) demo_output build

.PHONY: test lint clean
