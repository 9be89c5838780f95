"""Make the checkout of a tag ready to be built for the package index; run by release.yml.

It refuses a tag that is not that of the version, and a version whose section in the changelog
has no date. Then it makes the README's relative links absolute, which work on GitHub alone:
pages and pictures are those of the tag, in the repository in which the workflow runs.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]

PICTURES = (".gif", ".jpg", ".png", ".svg")


def version_of(package: str) -> str:
    """The version that the text of the package's `__init__.py` states."""
    found = re.search(r'^__version__ = "(.+)"$', package, re.M)
    assert found is not None
    return found[1]


def problem(tag: str, version: str, changelog: str) -> str | None:
    """Why this must not be released, if anything speaks against it."""
    if tag != f"v{version}":
        return f"the tag {tag} is not that of version {version}: v{version}"
    if not re.search(rf"^## {re.escape(version)} \(\d{{4}}-\d\d-\d\d\)$", changelog, re.M):
        return f"CHANGELOG.md has no section '## {version} (YYYY-MM-DD)'"
    return None


def absolute(text: str, repository: str, tag: str) -> str:
    """A top-level page with absolute links.

    Args:
        text: Markdown, with or without pieces of HTML.
        repository: its address.
        tag: whose pages and pictures are linked.
    """

    def address(match: re.Match[str]) -> str:
        before, target, after = match.groups()
        if re.match(r"[a-z]+:|#|//", target):
            return match[0]
        kind = "raw" if target.endswith(PICTURES) else "blob"
        return f"{before}{repository}/{kind}/{tag}/{target}{after}"

    def linked(block: str) -> str:
        if block.startswith("```"):
            return block  # code stays as it is
        block = re.sub(r"(\]\()([^)\s]+)(\))", address, block)
        return re.sub(r"(\b(?:src|href)=\")([^\"]+)(\")", address, block)

    return "".join(map(linked, re.split(r"(^```.*?^```$)", text, flags=re.M | re.S)))


def main(environment: Mapping[str, str] = os.environ, root: Path = ROOT) -> None:
    """Check the tag, and rewrite the README.

    Args:
        environment: the variables that GitHub sets.
        root: the checkout.

    Raises:
        SystemExit: this must not be released.
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
