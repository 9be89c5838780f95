"""The policy to be evaluated: one of this package, or a callable of the user."""

from __future__ import annotations

import hashlib
import inspect
import re
import runpy
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from DroneSwarmSearch._internal import checks
from DroneSwarmSearch._internal.errors import did_you_mean
from DroneSwarmSearch.core.scenario import Scenario
from DroneSwarmSearch.policies import POLICIES


@dataclass(frozen=True, eq=False)
class PolicySpec:
    """A policy to be evaluated; make one with `PolicySpec.of`.

    `source` is the policy as given, and the SHA-256 of its files, for manifests; None for one in
    memory. `policy` is a callable, or a class (with `arguments`, any function) that makes one
    from a `Scenario` and `arguments`.
    """

    name: str
    source: Mapping[str, str] | None
    policy: Any
    arguments: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        checks.name_text("name", self.name)

    @property
    def kind(self) -> type:
        """The class of the policy's objects, or of the callable."""
        return self.policy if inspect.isclass(self.policy) else type(self.policy)

    @classmethod
    def of(cls, policy: object, name: str | None = None) -> PolicySpec:
        """Make a spec from a policy as for `evaluate`.

        Raises OSError, TypeError or ValueError if there is no such policy.
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
            return cls(str(own_name) if name is None else name, source=None, policy=policy)
        if policy in POLICIES:
            return cls(policy if name is None else name, {"policy": policy}, POLICIES[policy])
        parts = re.fullmatch(r"(.+\.py):(\w+)(?::(.+))?", policy)
        if parts is None:
            raise ValueError(
                f"policy must be one of {', '.join(POLICIES)}, or 'file.py:Class' or "
                f"'file.py:Class:argument', got {policy!r:.100}{did_you_mean(policy, POLICIES)}"
            )
        file, own_name, argument = parts.groups()
        found = _imported(file, own_name)
        files = [Path(file)]
        if argument is not None and Path(argument).is_file():
            own_name = Path(argument).stem
            files.append(Path(argument))
        digest = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
        arguments = () if argument is None else (argument,)
        source = {"policy": policy, "sha256": digest}
        return cls(own_name if name is None else name, source, found, arguments)

    def make(self, scenario: Scenario) -> Callable[..., Any]:
        """Make the policy for a search with the given scenario."""
        made: Callable[..., Any] = self.policy
        if self.kind is self.policy or self.arguments:
            made = self.policy(scenario, *self.arguments)
        return made


def _imported(file: str, attribute: str) -> Callable[..., Any]:
    """A callable of a file."""
    path = Path(file)
    sys.path.insert(0, str(path.parent.resolve()))  # as when Python runs the file
    # Workers cannot import the module, so joblib pickles its content with the policy.
    content = runpy.run_path(file, run_name=f"_policy_{path.stem}")
    found: Callable[..., Any] | None = content.get(attribute)
    if not callable(found):
        raise ValueError(f"policy must name a callable, but {file} has none called {attribute!r}")
    return found
