"""Elements of XML."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any


def add(parent: ET.Element, tag: str, **children: Any) -> ET.Element:
    """Add an element with its children: texts, or elements as dicts."""
    element = ET.SubElement(parent, tag)
    for name, child in children.items():
        if isinstance(child, dict):
            add(element, name, **child)
        else:
            ET.SubElement(element, name).text = str(child)
    return element


def as_bytes(root: ET.Element) -> bytes:
    """The content of a file."""
    ET.indent(root)
    content: bytes = ET.tostring(root, "utf-8", xml_declaration=True)
    return content
