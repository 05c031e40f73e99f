"""Formulas as MathML, which browsers draw without fonts or scripts from elsewhere, and numbers that stay whole.

In a page: a fenced block ``math``, or ``$`...`$`` within a line, in LaTeX, as GitHub reads them, too.
"""

from __future__ import annotations

import re

BLOCK = re.compile(r"^```math\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
WITHIN = re.compile(r"\$`([^`\n]+)`\$")

UNIT = re.compile(r"(?<=\d) (?=%|±|kPa|MPa)|(?<=±) (?=\d)")


def with_whole_numbers(text: str) -> str:
    """Return a page in whose tables no line breaks between a number and its unit or error."""
    return re.sub(r"^\|.*", lambda row: UNIT.sub("\u00a0", row[0]), text, flags=re.MULTILINE)


def with_formulas(text: str) -> str:
    """Return a page with its formulas as MathML."""
    from latex2mathml.converter import convert

    text = BLOCK.sub(lambda found: f"<p>{convert(found[1].strip(), display='block')}</p>", text)
    return WITHIN.sub(lambda found: convert(found[1], display="inline"), text)
