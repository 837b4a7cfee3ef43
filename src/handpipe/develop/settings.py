"""Print the page of settings, every named number that results depend on: python -m handpipe.develop.settings.

A setting is a number, or a few, at the top of a module in capitals, or a field of a class of settings. Its
comment begins with its unit, or with the units of several numbers in their order. A comment without a unit
belongs to a pure number: a share, a ratio or a count. Tables of indices, of anatomies and of file formats are
data, and not listed.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).parents[1]
UNIT = (
    r"(?:1/mm\^2|1/mm|1/deg|rad/mm|mN/mm|kPa/mm|Hz/voxel|MHz/T|mm\^[23]|mm|rad|deg|kPa|mN|ppm|ms|s|T"
    r"|voxels?|pixels?|bytes|levels?)(?![\w/^-])"
)
UNITS = rf"(?:{UNIT}|1(?= and|,))(?:(?:, | and )(?:{UNIT}|1\b))*"  # of several numbers, in order
BEGINS_WITH_UNITS = re.compile(rf"({UNITS})[ ,;:]*(.*)", re.DOTALL)
NAMES_UNITS = re.compile(rf"(?:\bin|,|^) ?({UNITS})")
CLASSES = re.compile(r"(Settings|Options|Limits|Prior|Knowledge|Segmentation|Warp)$")
RECORDS = re.compile(rf"{CLASSES.pattern}|(Material|MotionNoise|Stop|Contact|Closing)$")
FUNCTIONS = ("radians", "sqrt", "cos", "sin", "arange", "linspace", "float")
PURE = "1"  # the unit of a share, a ratio or a count


@dataclass(frozen=True)
class Setting:
    """A named number of a module: its value as it is written, its unit and its meaning."""

    module: str
    name: str
    value: str
    unit: str
    meaning: str


def settings(path: Path) -> list[Setting]:
    """Settings of a module, in the order in which they are written."""
    text = path.read_text(encoding="utf-8")
    tree, comments = ast.parse(text), _comments(text)
    module = ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    return [*_constants(module, tree, comments), *_fields(module, tree, comments)]


def of_package() -> dict[str, list[Setting]]:
    """Settings of every module that has some, by the module's dotted name."""
    found = {path: settings(path) for path in sorted(SOURCE.rglob("*.py"))}
    return {of_module[0].module: of_module for of_module in found.values() if of_module}


def page() -> str:
    """The page of settings in Markdown, a table a module; no other package is needed for it."""
    about = (__doc__ or "").partition("\n\n")[2].replace("\n", " ")
    lines = ["# Settings\n", about.strip()]
    room = ""
    for module, found in of_package().items():
        if module.partition(".")[0] != room:
            room = module.partition(".")[0]
            lines.append(f"\n## {room}")
        lines += [f"\n### {module}\n", "| setting | value | unit | meaning |", "| --- | --- | --- | --- |"]
        lines += [f"| `{s.name}` | `{s.value}` | {s.unit} | {_cell(s.meaning)} |" for s in found]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    return re.sub(r"(?<!`)<(?=\w)", "&lt;", text.replace("|", r"\|"))


def _comments(text: str) -> dict[int, tuple[bool, str]]:
    """Comments by their line: whether one has its line for itself, and its text."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return {
        token.start[0]: (token.line.lstrip().startswith("#"), token.string.lstrip("# "))
        for token in tokens
        if token.type == tokenize.COMMENT
    }


def _comment(node: ast.stmt, comments: dict[int, tuple[bool, str]]) -> str:
    """The comment behind a statement; else the one above it, with the lines that it has."""
    lines = range(node.lineno, (node.end_lineno or node.lineno) + 1)
    behind = [comments[line][1] for line in lines if line in comments and not comments[line][0]]
    if behind:
        return " ".join(behind)
    above: list[str] = []
    line = node.lineno - 1
    while line in comments and comments[line][0]:
        above.insert(0, comments[line][1])
        line -= 1
    return " ".join(above)


def _constants(module: str, tree: ast.Module, comments: dict[int, tuple[bool, str]]) -> Iterator[Setting]:
    known: set[str] = set()
    for node in tree.body:
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        value = getattr(node, "value", None)
        elements = target.elts if isinstance(target, ast.Tuple) else [target]
        names = [e.id for e in elements if isinstance(e, ast.Name) and e.id.lstrip("_").isupper()]
        if not names or not isinstance(value, ast.expr) or not _is_number(value, known):
            continue
        known.update(names)
        unit, meaning = _unit_and_meaning(_comment(node, comments))
        if unit == PURE and ast.unparse(value).startswith("np.radians"):
            unit = "rad"
        yield Setting(module, ", ".join(names), _written(value), unit, meaning)


def _unit_and_meaning(comment: str) -> tuple[str, str]:
    """The unit with which a comment begins, and what it says then."""
    match = BEGINS_WITH_UNITS.match(comment)
    return (match[1], match[2]) if match else (PURE, comment)


def _written(value: ast.expr) -> str:
    text = ast.unparse(value).replace("np.", "")
    return text[1:-1] if isinstance(value, ast.Tuple) else text


def _is_number(value: ast.expr, known: set[str]) -> bool:
    """Whether an expression is a number, several, or a record of numbers; tables of indices are none."""

    def every(parts: list[ast.expr]) -> bool:
        return bool(parts) and all(_is_number(part, known) for part in parts)

    match value:
        case ast.Constant():
            return isinstance(value.value, int | float) and not isinstance(value.value, bool)
        case ast.UnaryOp():
            return _is_number(value.operand, known)
        case ast.BinOp():
            return every([value.left, value.right])
        case ast.Name():
            return value.id in known
        case ast.Attribute():
            return ast.unparse(value) in ("np.pi", "np.inf")
        case ast.Tuple() | ast.List():
            return every(value.elts)
        case ast.Call():
            return _is_number_of_call(value, every)
    return False


def _is_number_of_call(call: ast.Call, every: Callable[[list[ast.expr]], bool]) -> bool:
    name = ast.unparse(call.func).rpartition(".")[2]
    parts = [*call.args, *(keyword.value for keyword in call.keywords)]
    if name == "array":
        flat = isinstance(parts[0], ast.List) and not any(isinstance(e, ast.List) for e in parts[0].elts)
        return flat and "." in ast.unparse(parts[0]) and every(parts)
    if name in FUNCTIONS:
        return every(parts)
    switches = [p for p in parts if not (isinstance(p, ast.Constant) and isinstance(p.value, bool))]
    return bool(RECORDS.search(name)) and every(switches)


def _fields(module: str, tree: ast.Module, comments: dict[int, tuple[bool, str]]) -> Iterator[Setting]:
    """Fields with a number as their default, of classes of settings."""
    classes = (
        node for node in ast.walk(tree) if isinstance(node, ast.ClassDef) and CLASSES.search(node.name)
    )
    for node in classes:
        described = _parameters(ast.get_docstring(node) or "")
        for field in node.body:
            if not isinstance(field, ast.AnnAssign) or field.value is None:
                continue
            value, text = _default(field.value)
            if not _is_number(value, set()):
                continue
            name = ast.unparse(field.target)
            unit, meaning = _unit_and_meaning(_comment(field, comments)) if not text else (PURE, text)
            if not meaning:
                meaning = described.get(name, "")
            if unit == PURE and (named := NAMES_UNITS.search(meaning)):
                unit = named[1]
            yield Setting(module, f"{node.name}.{name}", _written(value), unit, meaning)


def _default(value: ast.expr) -> tuple[ast.expr, str]:
    """A field's default and, where pydantic's `Field` gives them, its description."""
    if not isinstance(value, ast.Call) or ast.unparse(value.func) != "Field":
        return value, ""
    given = {k.arg: k.value for k in value.keywords}
    text = ast.literal_eval(given["description"]) if "description" in given else ""
    return value.args[0] if value.args else given.get("default", ast.Constant(None)), str(text)


def _parameters(docstring: str) -> dict[str, str]:
    """Descriptions of a docstring's parameters by name."""
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-{3,}$|\Z)", docstring, re.MULTILINE | re.DOTALL
    )
    parts = re.split(r"^(\w+(?:, \w+)*) : .*$", section[1] if section else "", flags=re.MULTILINE)
    return {
        name: " ".join(text.split())
        for names, text in zip(parts[1::2], parts[2::2], strict=True)
        for name in names.split(", ")
    }


if __name__ == "__main__":
    print(page(), end="")
