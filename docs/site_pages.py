"""Pages of the site that are made of other files: start page, configuration, settings, gallery, API."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "src"))  # of handpipe, this module alone is used, which needs no other package
from handpipe.develop import settings  # noqa: E402

PACKAGE = ROOT / "src" / "handpipe"
COPIES = {"README.md": "index.md", "config/README.md": "reference/configuration.md"}
COPIES |= {"CONTRIBUTING.md": "develop/contributing.md"}


def on_config(config: Any) -> Any:
    """Add the generated pages to the navigation."""
    api = [{name: page} for name, page in api_pages().items()]
    for section in config.nav:
        if "Reference" in section:
            section["Reference"].append({"API": api})
        if "Develop" in section:
            section["Develop"].append({"Contribute": "develop/contributing.md"})
        if "Decisions" in section:
            pages = sorted((ROOT / "docs" / "decisions").glob("2*.md"))
            section["Decisions"] += [f"decisions/{page.name}" for page in pages]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages to the files of the site."""
    pages = {page: _copied(source, page) for source, page in COPIES.items()}
    pages |= {page: f"# {name}\n\n::: {name}\n" for name, page in api_pages().items()}
    pages["gallery.md"] = gallery()
    pages["reference/settings.md"] = settings.page()
    for page, text in pages.items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Point links to files that the site has under another name to that name."""
    up = "../" * page.file.src_uri.count("/")
    for source, target in COPIES.items():
        markdown = re.sub(rf"\]\((\.\./)+{re.escape(source)}", f"]({up}{target}", markdown)
    return markdown


def api_pages() -> dict[str, str]:
    """Page of each package and each module at the top, by dotted name."""
    names = [p.parent.name for p in PACKAGE.glob("*/__init__.py")] + [
        p.stem for p in PACKAGE.glob("[a-z]*.py")
    ]
    return {f"handpipe.{name}": f"reference/api/{name}.md" for name in sorted(names)}


def gallery() -> str:
    """One section for each file of examples/: its docstring and its text."""
    about = "Each example runs in seconds: `python examples/NAME.py`. Tests run all of them."
    parts = [f"# Gallery of examples\n\n{about}\n"]
    for path in sorted((ROOT / "examples").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        title, _, about = (ast.get_docstring(ast.parse(text)) or path.stem).partition("\n")
        code = text.split('"""', 2)[2].strip()
        parts.append(
            f"## {title.rstrip('.')}\n\n`examples/{path.name}`\n\n{about}\n\n```python\n{code}\n```\n"
        )
    return "\n".join(parts)


def _copied(source: str, page: str) -> str:
    """Text of a file with its links as seen from the page. Files outside the site are named, not linked."""
    folder, up = (ROOT / source).parent, "../" * page.count("/")

    def link(match: re.Match[str]) -> str:
        text, (path, _, anchor) = match[1], match[2].partition("#")
        target = (folder / path).resolve()
        if not path or "://" in path or not target.exists():
            return match[0]
        name = target.relative_to(ROOT).as_posix()
        inside = name in COPIES or target.is_relative_to(ROOT / "docs")
        if not inside:
            return f"{text} (`{name}`)" if text != name else f"`{name}`"
        name = COPIES.get(name, name.removeprefix("docs/"))
        return f"[{text}]({up}{name}{f'#{anchor}' if anchor else ''})"

    return re.sub(r"\[([^\]]*)\]\(([^)\s]+)\)", link, (ROOT / source).read_text(encoding="utf-8"))
