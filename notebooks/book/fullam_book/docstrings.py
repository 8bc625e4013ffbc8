"""Sphinx extension: docstrings are text for people, not reStructuredText.

Single backticks are code, an indented block after an empty line is a formula as it stands, and
stars, bars and trailing underscores are just that.
"""

from __future__ import annotations

import inspect
import re
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.transforms import SphinxTransform

SECTION = re.compile(r"(Args|Attributes|Returns|Raises|Yields|Note|Example|Examples):$")
HANGING = re.compile(
    rf"(?<=\n\n)(?!{SECTION.pattern}|[-*\d] )\S[^\n]*(?:\n\S[^\n]*)*\n +\S[^\n]*(?:\n[^\n]+)*", re.M
)
"""A paragraph that is no section and no list, and has lines that begin further in."""

LONGEST_VALUE = 60
"""Values of more characters are not shown."""

EMPHASIS = re.compile(r"((?<![\w*])\*\w[\w -]*\w\*(?![\w*]))")
CODE = re.compile(r"(`+)([^`]+)\1")


def readable(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Rewrite a docstring in place, before napoleon reads its sections."""
    lines[:] = set_off(lines)
    if what in ("data", "attribute", "property"):
        lines.insert(0, "\\")  # else napoleon takes words before a colon for a type
    text: list[str] = []
    in_section = verbatim = False
    for index, line in enumerate(lines):
        bare = line.strip()
        indent = len(line) - len(line.lstrip())
        if bare and indent == 0:
            in_section, verbatim = bool(SECTION.match(bare)), False
        after_gap = index > 0 and not lines[index - 1].strip()
        opens = bare and indent >= 4 and after_gap and not in_section
        if opens and not verbatim:
            text += ["::", ""]
            verbatim = True
        text.append(line if verbatim else escaped(line))
    lines[:] = text


def set_off(lines: list[str]) -> list[str]:
    """The lines with tables of words, whose lines hang below the first, moved in by four."""
    text = "\n".join(lines)
    return re.sub(HANGING, lambda table: re.sub("(?m)^", "    ", table[0]), text).split("\n")


def escaped(line: str) -> str:
    """A line in which only code is marked up."""
    parts, last = [], 0
    for match in CODE.finditer(line):
        parts += [plain(line[last : match.start()]), f"``{match[2].strip()}``"]
        # Whatever follows a literal directly must be set off.
        if line[match.end() : match.end() + 1].isalnum():
            parts.append("\\ ")
        last = match.end()
    return "".join([*parts, plain(line[last:])])


def plain(text: str) -> str:
    """Text with the signs escaped that would be markup; an emphasised word stays one."""
    parts = EMPHASIS.split(text)
    parts[::2] = [re.sub(r"([*|\\`])", r"\\\1", part) for part in parts[::2]]
    return re.sub(r"(?<=\w)_(?=\W|$)", r"\\_", "".join(parts))


class OwnReferences(SphinxTransform):
    """Types of other packages stay words: nothing on this disk explains them.

    Leaving them to the reference resolver takes a search through all names each.
    """

    default_priority = 5

    def apply(self, **kwargs: Any) -> None:
        """Put its text in place of each reference that leads out of the package."""
        for node in list(self.document.findall(addnodes.pending_xref)):
            if node.get("refdomain") == "py" and not node["reftarget"].startswith("fullam."):
                node.replace_self(node.children)


def skipped(app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out values that no docstring of their own explains."""
    if what not in ("module", "data") or inspect.isclass(obj) or inspect.isroutine(obj):
        return None
    module = app.env.current_document.docname.removeprefix("api/")
    if ("", name) not in ModuleAnalyzer.for_module(module).find_attr_docs():
        return True
    return None


def tidied(app: Sphinx, domain: str, objtype: str, content: addnodes.desc_content) -> None:
    """Leave out what tells nothing: long values, the base of all classes; and set dashes."""
    for part in list(content.parent.findall(addnodes.desc_annotation)):
        if part.astext().startswith(" = ") and len(part.astext()) > LONGEST_VALUE:
            part.parent.remove(part)
    first = content.children[0] if content.children else None
    if first is not None and first.astext() == "Bases: object":
        content.remove(first)
    for text in list(content.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" – "))


def setup(app: Sphinx) -> dict[str, Any]:
    """Come before napoleon."""
    app.connect("autodoc-process-docstring", readable, priority=100)
    app.connect("autodoc-skip-member", skipped)
    app.connect("object-description-transform", tidied)
    app.add_transform(OwnReferences)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
