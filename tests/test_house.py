"""Rooms and faces: what docs/architecture.md says of packages holds."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[1]
SOURCE = CHECKOUT / "src" / "handpipe"
ROOMS = sorted(path.parent for path in SOURCE.rglob("__init__.py") if path.parent != SOURCE)
MOST_MODULES = 12
DOCS = [CHECKOUT / "README.md", *(CHECKOUT / "docs").rglob("*.md")]


def name_of(folder: Path) -> str:
    return ".".join(folder.relative_to(SOURCE.parent).parts)


@cache
def exports(room: str) -> frozenset[str]:
    """What a package lists in `__all__`."""
    tree = ast.parse((SOURCE.parent.joinpath(*room.split(".")) / "__init__.py").read_text(encoding="utf-8"))
    found = [ast.literal_eval(node.value) for node in tree.body if is_list_of_exports(node)]
    return frozenset(found[0]) if found else frozenset()


def is_list_of_exports(node: ast.stmt) -> bool:
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
    return target is not None and ast.unparse(target) == "__all__"


def owner(dotted: str) -> str:
    """The package of a dotted name: the first name below `handpipe`; each tissue is a package of its own."""
    parts = dotted.split(".")
    return ".".join(parts[1:3] if parts[1] == "tissues" else parts[1:2])


def imports(text: str) -> Iterator[tuple[str, str]]:
    """Every import from `handpipe` in a Python file: of which module, which name."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "handpipe":
            yield from ((str(node.module), alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                assert not alias.name.startswith("handpipe."), f"import {alias.name}: import a name from it"


def past_a_face(module: str, name: str) -> bool:
    """Whether an import from outside asks for what no face exports.

    A module that a face exports is public as a whole.
    """
    if module == "handpipe":
        return not (SOURCE / name / "__init__.py").is_file() and name != "__version__"
    if (SOURCE.parent.joinpath(*module.split(".")) / "__init__.py").is_file():
        return name not in exports(module)
    room, _, last = module.rpartition(".")
    return last not in exports(room)


@pytest.mark.parametrize("room", ROOMS, ids=name_of)
def test_a_room_has_at_most_a_dozen_modules_on_one_level(room: Path) -> None:
    modules = [path.name for path in room.glob("*.py") if path.name not in ("__init__.py", "__main__.py")]
    assert len(modules) <= MOST_MODULES, "a room with more modules wants rooms of its own"


@pytest.mark.parametrize("room", ROOMS, ids=name_of)
def test_a_room_says_what_it_is_for_and_lists_what_it_exports(room: Path) -> None:
    tree = ast.parse((room / "__init__.py").read_text(encoding="utf-8"))
    assert ast.get_docstring(tree)
    assert any(is_list_of_exports(node) for node in tree.body)
    listed = [
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module not in ("typing", "handpipe.core.faces")
        for alias in node.names
    ]
    assert sorted(listed) == sorted(exports(name_of(room)))


@pytest.mark.parametrize("room", ROOMS, ids=name_of)
def test_no_export_has_the_name_of_another_module_of_its_room(room: Path) -> None:
    """Python would give the module once it is loaded, and the export before."""
    tree = ast.parse((room / "__init__.py").read_text(encoding="utf-8"))
    passed_on = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module not in ("typing", name_of(room))
        for alias in node.names
    }
    inside = {path.stem for path in room.glob("*.py")} | {
        path.parent.name for path in room.glob("*/__init__.py")
    }
    assert passed_on & inside == set()


def test_other_packages_import_faces_only() -> None:
    wrong = []
    for path in sorted(SOURCE.rglob("*.py")):
        own = owner(".".join(path.relative_to(SOURCE.parent).with_suffix("").parts))
        for module, name in imports(path.read_text(encoding="utf-8")):
            inside = owner(f"{module}.{name}") == own or module == "handpipe.core.faces"
            if not inside and past_a_face(module, name):
                wrong.append(f"{path.relative_to(CHECKOUT)}: from {module} import {name}")
    assert wrong == []


def test_rules_examples_and_docs_import_faces_only() -> None:
    """Tests and benchmarks may import any module."""
    texts = {path: path.read_text(encoding="utf-8") for path in (CHECKOUT / "examples").glob("*.py")}
    texts |= {path: path.read_text(encoding="utf-8") for path in (CHECKOUT / "workflow").rglob("*.py")}
    for path in (*DOCS, CHECKOUT / "Snakefile", *(CHECKOUT / "workflow").rglob("*.smk")):
        lines = r"^from handpipe\S* import (?:\([^)]*\)|.*)$"
        texts[path] = "\n".join(re.findall(lines, path.read_text(encoding="utf-8"), re.MULTILINE))
    wrong = [
        f"{path.relative_to(CHECKOUT)}: from {module} import {name}"
        for path, text in texts.items()
        for module, name in imports(text)
        if past_a_face(module, name)
    ]
    assert wrong == []


def test_docs_name_what_there_is() -> None:
    """Dotted names and files of the library in pages of what is done now."""
    files = {path.relative_to(SOURCE).as_posix() for path in SOURCE.rglob("*.py")}
    rooms = {room.name for room in ROOMS if room.parent == SOURCE}
    wrong = []
    for page in DOCS:
        if page.parent.name == "decisions" or page.name in ("earlier-results.md", "results.md"):
            continue
        text = page.read_text(encoding="utf-8")
        for dotted in re.findall(r"`(?:python -m )?handpipe((?:\.\w+)+)", text):
            found, parts = SOURCE, dotted.split(".")[1:]
            while parts and (found / parts[0] / "__init__.py").is_file():
                found /= parts.pop(0)
            if parts and not (found / f"{parts[0]}.py").is_file() and parts[0] not in exports(name_of(found)):
                wrong.append(f"{page.relative_to(CHECKOUT)}: handpipe{dotted}")
        for file in re.findall(r"`(?:src/handpipe/)?(\w+/[\w/]+\.py)", text):
            if file.partition("/")[0] in rooms and file not in files:
                wrong.append(f"{page.relative_to(CHECKOUT)}: {file}")
    assert wrong == []


def test_importing_a_room_loads_no_module_of_it() -> None:
    code = (
        "import sys, handpipe.fem.solver; print(*sorted(m for m in sys.modules if m.startswith('handpipe')))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.split() == [
        "handpipe",
        "handpipe.core",
        "handpipe.core.faces",
        "handpipe.fem",
        "handpipe.fem.solver",
    ]
