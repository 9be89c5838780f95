"""What holds for all tests."""

from __future__ import annotations

import pytest

from DroneSwarmSearch.policies import planner


@pytest.fixture(autouse=True)
def quick_plans(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans begun in two ways only, but for tests marked as being about their quality."""
    if request.node.get_closest_marker("good_plans") is None:
        monkeypatch.setattr(planner, "STARTS", 0)
