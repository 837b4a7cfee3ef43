"""Parts of a document that a command renews, between two markers."""

from __future__ import annotations


def between(text: str, part: str, command: str, content: str) -> str:
    """The text with other content between the markers of a part, which name the command that renews it."""
    begin, end = f"<!-- {part}: {command} -->", f"<!-- end of {part} -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"the document lacks the markers {begin} and {end}")
    return f"{before}{begin}\n\n{content}\n\n{end}{after}"
