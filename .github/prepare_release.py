"""Prepare a tagged checkout for the package index; run by release.yml.

The tag has to match the version, and the version's section in the changelog needs a date. Then
the README's relative links, which work on GitHub only, become absolute: they point to the pages
and pictures of the tag, in the repository that runs the workflow.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]

PICTURES = (".gif", ".jpg", ".png", ".svg")


def version_of(package: str) -> str:
    """The version in the text of the package's `__init__.py`."""
    found = re.search(r'^__version__ = "(.+)"$', package, re.M)
    assert found is not None
    return found[1]


def problem(tag: str, version: str, changelog: str) -> str | None:
    """The reason not to release, or None."""
    if tag != f"v{version}":
        return f"the tag {tag} does not match version {version}, which needs v{version}"
    if not re.search(rf"^## {re.escape(version)} \(\d{{4}}-\d\d-\d\d\)$", changelog, re.M):
        return f"CHANGELOG.md has no section '## {version} (YYYY-MM-DD)'"
    return None


def absolute(text: str, repository: str, tag: str) -> str:
    """Make the links of a top-level page absolute.

    Args:
        text: Markdown, possibly with HTML.
        repository: its address.
        tag: of the linked pages and pictures.
    """

    def address(match: re.Match[str]) -> str:
        before, target, after = match.groups()
        if re.match(r"[a-z]+:|#|//", target):
            return match[0]
        kind = "raw" if target.endswith(PICTURES) else "blob"
        return f"{before}{repository}/{kind}/{tag}/{target}{after}"

    def linked(block: str) -> str:
        if block.startswith("```"):
            return block
        block = re.sub(r"(\]\()([^)\s]+)(\))", address, block)
        return re.sub(r"(\b(?:src|srcset|href)=\")([^\"]+)(\")", address, block)

    return "".join(map(linked, re.split(r"(^```.*?^```$)", text, flags=re.M | re.S)))


def main(environment: Mapping[str, str] = os.environ, root: Path = ROOT) -> None:
    """Check the tag, and rewrite the README.

    Args:
        environment: the environment variables set by GitHub.
        root: the checkout.

    Raises:
        SystemExit: the checkout must not be released.
    """
    tag = environment["GITHUB_REF_NAME"]
    version = version_of((root / "DroneSwarmSearch" / "__init__.py").read_text("utf-8"))
    why = problem(tag, version, (root / "CHANGELOG.md").read_text("utf-8"))
    if why is not None:
        raise SystemExit(why)
    repository = f"{environment['GITHUB_SERVER_URL']}/{environment['GITHUB_REPOSITORY']}"
    readme = root / "README.md"
    text = absolute(readme.read_text("utf-8"), repository, tag)
    readme.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
