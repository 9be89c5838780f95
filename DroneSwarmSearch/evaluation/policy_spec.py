"""The policy to be evaluated: one of this package, or a callable of the user."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import re
import runpy
import sys
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch._internal.extras import needed
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.layouts.view import View
from DroneSwarmSearch.policies import POLICIES
from DroneSwarmSearch.policies.imitation import ImitationPolicy, Network


@dataclass(frozen=True, eq=False)
class PolicySpec:
    """A policy to be evaluated; make one with `PolicySpec.of`.

    `source` is the policy as given, and the SHA-256 of its file, for manifests; None for one in
    memory. `policy` is a callable, or a class (with `arguments`, any function) that makes one
    from a `Scenario` and `arguments`. `view` is what it sees, as far as known.
    """

    name: str
    source: Mapping[str, str] | None
    policy: Any
    arguments: tuple[str, ...] = ()
    view: View | None = None

    @property
    def kind(self) -> type:
        """The class of the policy's objects, or of the callable."""
        return self.policy if inspect.isclass(self.policy) else type(self.policy)

    @classmethod
    def of(cls, policy: object, name: str | None = None) -> PolicySpec:
        """Make a spec from a policy as for `evaluate`; a string may begin with "name=".

        Raises ImportError, OSError, TypeError or ValueError if there is no such policy.
        """
        if isinstance(policy, PolicySpec):
            return policy
        if not isinstance(policy, str):
            if not callable(policy):
                raise TypeError(
                    "policy must be a policy's name or a callable from observations to actions, "
                    f"got {policy!r:.100}"
                )
            own_name = getattr(policy, "__name__", type(policy).__name__)
            return cls(name or str(own_name), None, policy)
        if name is None and (named := re.match(r"([\w-]+)=", policy)):
            return cls.of(policy[named.end() :], named[1])
        found: Any
        file: str | None
        arguments: tuple[str, ...] = ()
        own_name = policy
        if parts := re.fullmatch(r"(.+\.py|[\w.]+):(\w+)(?::(.+))?", policy):
            where, own_name, argument = parts.groups()
            found, file = _imported(where, own_name)
            if argument is not None:
                arguments = (argument,)
        elif policy.endswith(".npz"):
            Network.load(policy)
            found, file, arguments, own_name = ImitationPolicy, policy, (policy,), Path(policy).stem
        elif policy.endswith(".zip"):
            if not zipfile.is_zipfile(policy):
                raise ValueError(f"policy must be a saved model, but {policy} is no zip file")
            sb3 = needed("DroneSwarmSearch.adapters.sb3", "a saved model needs its library", "sb3")
            file, arguments, own_name = policy, (policy,), Path(policy).stem
            found = sb3.SB3Policy
        elif policy in POLICIES:
            found, file = POLICIES[policy], None
        else:
            hint = did_you_mean(policy, POLICIES)
            if policy.endswith(".py"):
                hint = f"; name an attribute of the file, too, as in '{policy}:policy'"
            raise ValueError(
                f"policy must be one of {', '.join(POLICIES)}, 'weights.npz', 'model.zip', "
                "'module:attribute', 'file.py:attribute' or 'file.py:Class:argument', got "
                f"{policy!r:.100}{hint}"
            )
        source = {"policy": policy}
        files = [Path(name) for name in (file, *arguments) if name and Path(name).is_file()]
        if files:
            content = b"".join(each.read_bytes() for each in dict.fromkeys(files))
            source["sha256"] = hashlib.sha256(content).hexdigest()
        return cls(name or own_name, source, found, arguments)

    def make(self, scenario: Scenario) -> Callable[..., Any]:
        """Make the policy for a search with the given scenario."""
        made: Callable[..., Any] = self.policy
        if self.kind is self.policy or self.arguments:
            made = self.policy(scenario, *self.arguments)
        return made


def _imported(where: str, attribute: str) -> tuple[Callable[..., Any], str | None]:
    """A callable of a file or a module, and the file."""
    found: Any
    if where.endswith(".py"):
        path = Path(where)
        sys.path.insert(0, str(path.parent.resolve()))  # as when Python runs the file
        # Workers cannot import the module, so joblib pickles its content with the policy.
        found = runpy.run_path(where, run_name=f"_policy_{path.stem}").get(attribute)
        file: str | None = where
    else:
        module = importlib.import_module(where)
        found, file = getattr(module, attribute, None), getattr(module, "__file__", None)
    if not callable(found):
        raise ValueError(f"policy must name a callable, but {where} has none called {attribute!r}")
    return found, file
