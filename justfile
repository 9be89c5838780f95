# The commands of contributors; `just` lists them, CONTRIBUTING.md explains them.
# Options are passed on: `just test -k golden`.

set windows-shell := ["powershell.exe", "-NoLogo", "-Command"]

_list:
    @just --list --unsorted

# install the package with all development tools, and the pre-commit hooks
setup:
    python -m pip install -e ".[dev]"
    python -m pre_commit install

# play a search; --help lists the options
demo *options:
    python basic_env.py {{ options }}

# run the quick tests on all CPUs
test *options:
    python -m pytest -n auto {{ options }}

# run the thorough tests, too, which take seconds each
thorough *options:
    python -m pytest -n auto -m "not slow" {{ options }}

# run the slow tests
slow *options:
    python -m pytest -n auto --dist loadfile -m slow {{ options }}

# run the linter
lint:
    python -m ruff check .
    python -m ruff format --check .

# fix and format the code where the linter can
fix:
    python -m ruff check --fix .
    python -m ruff format .

# run the type checker
types:
    python -m mypy

# build the documentation in build/site; a warning is an error
docs:
    python -m sphinx -W --keep-going -q -d build/doctrees docs build/site

# test the documentation in a browser
site *options:
    python -m pytest -m slow tests/test_site.py {{ options }}

# regenerate the figures, pictures and episodes of the documentation
figures:
    python docs/make_figures.py
    python docs/make_pictures.py
    python docs/make_episodes.py

# regenerate the notebook of the tutorial
notebook:
    python docs/make_notebook.py

# write the file of the evaluation suite, from the searches in metres and seconds
suite:
    python docs/make_suite.py

# regenerate the golden traces; review the diff
golden *options:
    python tests/golden/regenerate.py {{ options }}

# regenerate the leaderboard; takes an hour on two cores, or less if it was interrupted
leaderboard *options:
    python -m DroneSwarmSearch leaderboard --submissions docs/leaderboard/submissions.csv --out docs/leaderboard {{ options }}
    python benchmarks/leaderboard_page.py

# train and evaluate what the benchmark lacks, and write its table
benchmark:
    python benchmarks/algorithms.py train
    python benchmarks/algorithms.py baselines
    python benchmarks/algorithms.py report
    python docs/make_figures.py benchmark

# measure the speed of batches on this machine
bench *options:
    python benchmarks/bench_vector.py {{ options }}

# build wheel and sdist in dist, and check them
build:
    python -m build
    python -m twine check --strict dist/*

# build and check, and list what is left to do before this version can be published
publish-check: build
    python .github/publish_check.py

# build wheel and sdist, and test the wheel (Linux and macOS)
wheel *dependencies:
    .ci/wheel {{ dependencies }}

# run the gate, or with `full` everything (Linux and macOS)
ci *full:
    .ci/run {{ full }}
