"""Adapters for RL libraries say which extra they need."""

import importlib
import sys

import pytest

LIBRARIES = {
    "benchmarl": "benchmarl",
    "rllib": "ray",
    "sb3": "stable_baselines3",
    "torchrl": "torchrl",
}


@pytest.mark.parametrize("extra", LIBRARIES)
def test_an_adapter_without_its_library_names_the_extra(extra, monkeypatch):
    module = f"DroneSwarmSearch.adapters.{extra}"
    monkeypatch.delitem(sys.modules, module, raising=False)
    for name in ("torch", LIBRARIES[extra]):
        monkeypatch.setitem(sys.modules, name, None)
    install = rf'pip install "DroneSwarmSearchEnvironment\[{extra}\]"'
    with pytest.raises(ImportError, match=install):
        importlib.import_module(module)
