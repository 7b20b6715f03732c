"""Which XML is let in: a bounded tree of plain elements, with no DOCTYPE, no entities and no network.

Expat expands entities only after a DOCTYPE has declared them; a text with a DOCTYPE is refused at its first
line, so neither a "billion laughs" nor an external file is ever looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from modelgen.errors import ModelgenError

LARGEST_TEXT = 8 * 1024 * 1024  # bytes
MOST_ELEMENTS = 100_000
DEEPEST = 64


@dataclass(slots=True)
class Element:
    """One element; `line` is counted from 1. Text between tags is not kept: a URDF has none that matters."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[Element]:
        """Children of this tag."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> Element | None:
        """The first child of this tag."""
        return next(self.all(tag), None)


def read(data: bytes) -> Element:
    """The root element of an XML text. Raises ModelgenError, one sentence."""
    if len(data) > LARGEST_TEXT:
        raise ModelgenError(
            f"is larger than {LARGEST_TEXT // 1024**2} MiB; a URDF names its meshes and does not hold them"
        )
    top = Element("", {}, 0)
    open_elements = [top]
    count = 0
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS or len(open_elements) > DEEPEST:
            raise ModelgenError(
                f"has more than {MOST_ELEMENTS} elements, or more than {DEEPEST} inside each other; "
                "give the URDF of one robot"
            )
        element = Element(tag, attributes, parser.CurrentLineNumber)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(tag: str) -> None:
        open_elements.pop()

    def doctype(*_: object) -> None:
        raise ModelgenError(
            f"has a DOCTYPE (line {parser.CurrentLineNumber}), which may hide entities; remove that line"
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.errors.messages.get(error.code, "unknown error")
        raise ModelgenError(f"is not valid XML (line {error.lineno}): {reason}; correct the syntax") from None
    except (ValueError, LookupError):  # an encoding that expat or Python does not know
        raise ModelgenError("is in an unknown encoding; save it as UTF-8") from None
    return top.children[0]
