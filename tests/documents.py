"""The pages of the documentation, and the blocks of code in them: shared by tests."""

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]


DOCS = sorted((ROOT / "docs").rglob("*.md"))


PAGES = [ROOT / "README.md", *DOCS]


EXTRAS = {
    **{name: name for name in ("agilerl", "benchmarl", "tianshou", "torchrl")},
    **dict.fromkeys(("sb3_contrib", "stable_baselines3", "supersuit"), "sb3"),
    **dict.fromkeys(("ray", "lz4"), "rllib"),
    "torch": "ppo",  # most of the others need it too
}
"""Optional packages that code blocks import, with the extra that installs them."""


FENCE = re.compile(r"^```(?!`)(\S*)[^\n]*\n(.*?)^```$", re.M | re.S)


def path_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


class Block(NamedTuple):
    """A code block of a page, and the output that the page shows."""

    name: str
    text: str
    output: str | None = None

    @property
    def optional_packages(self) -> list[str]:
        """The optional packages that it needs."""
        imported = {*re.findall(r"^(?:from|import) (\w+)", self.text, re.M)}
        imported |= {"ray"} if re.search(r"\bray=", self.text) else set()
        imported |= {"lz4"} if "ray.rllib" in self.text else set()  # not with ray alone
        return [package for package in EXTRAS if package in imported]

    @property
    def test_id(self):
        """The test's id: `-k needs-torchrl` selects all blocks that need this extra."""
        packages = self.optional_packages
        return f"{self.name}-needs-{EXTRAS[packages[0]]}" if packages else self.name


def blocks(language: str) -> list[Block]:
    """Return the code blocks of all pages in a language."""
    found = []
    for page in PAGES:
        text = re.sub(r"<!--.*?-->", "", page.read_text("utf-8"), flags=re.S)  # for the notebook
        fences = list(FENCE.finditer(text))
        number = 0
        for fence, following in zip(fences, [*fences, None][1:], strict=True):
            if fence[1] != language:
                continue
            output = following[2] if following is not None and following[1] == "text" else None
            if following is not None and "\n#" in text[fence.end() : following.start()]:
                output = None  # belongs to another section
            found.append(Block(f"{path_of(page)}-{number}", fence[2], output))
            number += 1
    return found
