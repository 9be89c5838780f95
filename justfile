# What contributors run, a recipe each: `just` lists them, CONTRIBUTING.md tells when.
# Options go on to the command: `just test -k golden`.

set windows-shell := ["powershell.exe", "-NoLogo", "-Command"]

_list:
    @just --list --unsorted

# install the package and everything below needs, and the hooks that run before a commit
setup:
    python -m pip install -e ".[dev]"
    python -m pre_commit install

# play a search; --help tells the ways
demo *options:
    python basic_env.py {{ options }}

# the tests, on all processors
test *options:
    python -m pytest -n auto {{ options }}

# the tests that take minutes
slow *options:
    python -m pytest -n auto --dist loadfile -m slow {{ options }}

# what the linter says
lint:
    python -m ruff check .
    python -m ruff format --check .

# let the linter mend and format what it can
fix:
    python -m ruff check --fix .
    python -m ruff format .

# the type checker
types:
    python -m mypy

# the site, in build/site; a warning is an error
docs:
    python -m sphinx -W --keep-going -q -d build/doctrees docs build/site

# the same, read in a browser: links, themes, phones, search
site *options:
    python -m pytest -m slow tests/test_site.py {{ options }}

# the figures and pictures of the documentation, anew
figures:
    python docs/make_figures.py
    python docs/make_pictures.py

# the traces of episodes, anew: read the diff
golden *options:
    python tests/golden/regenerate.py {{ options }}

# the leaderboard, anew; takes long unless its portions are there
leaderboard *options:
    python -m DroneSwarmSearch leaderboard --out docs/leaderboard {{ options }}

# how fast it is on this machine
bench *options:
    python tests/benchmarks/bench_vector.py {{ options }}

# the wheel and the sdist, in dist, checked
build:
    python -m build
    python -m twine check --strict dist/*

# the same, and the tests against what was built, away from the checkout (Linux and macOS)
wheel *dependencies:
    .ci/wheel {{ dependencies }}

# all that a change has to pass (Linux and macOS)
ci:
    .ci/run
