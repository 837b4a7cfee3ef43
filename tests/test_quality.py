"""The code's own rules: formatting, types, floors of docs/architecture.md, what every rule gives."""

import ast
import graphlib
import re
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest

from handpipe.core.layer_registry import LAYERS
from handpipe.synthetic import generators

CHECKOUT = Path(__file__).parents[1]
SOURCE = CHECKOUT / "src" / "handpipe"
PYTHON = sorted(SOURCE.rglob("*.py"))
TISSUES = tuple(f"tissues.{tissue}" for tissue in ("tendons", "muscles", "ligaments", "fascia", "fat"))
# What each package may import, besides itself and `core`; everything else is upwards.
FLOORS: dict[str, tuple[str, ...]] = {
    "core": (),
    "mesh": (),
    "fem": ("mesh",),
    "imaging": ("mesh", "fem"),
    "skeleton": ("mesh", "fem", "imaging"),
    "shapes": ("mesh", "fem", "imaging"),
    **dict.fromkeys(TISSUES, ("mesh", "fem", "imaging", "skeleton", "shapes")),
    "anatomy": ("mesh", "fem", "imaging", "skeleton", "tissues.muscles"),
    "hand": ("mesh", "fem", "imaging", "skeleton", "shapes", "anatomy", *TISSUES),
    "levels": ("mesh", "fem", "skeleton", *TISSUES, "hand"),
    "synthetic.continuum": ("mesh", "fem"),
    "synthetic.coupled": ("mesh", "fem", "synthetic.continuum"),
}
FLOORS["tissues.ligaments"] += ("tissues.muscles",)
BESIDE = ("synthetic", "evaluation", "develop")
TOP = ("stages", "cli")  # import all of them


@pytest.mark.parametrize(
    "tool",
    [
        "ruff check .",
        "ruff format --check .",
        "mypy",
        "snakefmt --check Snakefile workflow/helpers workflow/rules",
        "snakemake --lint",
    ],
)
def test_tools_find_nothing(tool: str) -> None:
    name, *arguments = tool.split()
    program = Path(sys.executable).with_name(name)
    process = subprocess.run(
        [program, *arguments], cwd=CHECKOUT, encoding="utf-8", capture_output=True, check=False
    )
    assert process.returncode == 0, process.stdout + process.stderr


@cache
def imported(path: Path) -> list[str]:
    """Dotted names of all that a file imports, inside functions too."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def imports() -> list[tuple[Path, str]]:
    """Every file of the library with each name that it imports."""
    return [(path, name) for path in sorted(SOURCE.rglob("*.py")) for name in imported(path)]


def package(dotted: str) -> str:
    """The package that a dotted name is of: what stands on a floor of its own."""
    parts = dotted.split(".")[1:]
    two = ".".join(parts[:2])
    return two if two in FLOORS else parts[0]


def package_of(path: Path) -> str:
    return package(".".join(path.relative_to(SOURCE.parent).with_suffix("").parts))


def is_face(path: Path) -> bool:
    return path.name == "__init__.py"


def test_no_import_goes_upwards() -> None:
    upwards = []
    for path, name in imports():
        own = package_of(path)
        if own not in FLOORS or name.partition(".")[0] != "handpipe" or name == "handpipe.__version__":
            continue
        if package(name) not in (own, "core", *FLOORS[own]):
            upwards.append(f"{path.relative_to(CHECKOUT)} imports {name}")
    assert upwards == []


def test_every_package_has_its_floor() -> None:
    packages = {package_of(path) for path in PYTHON if path.parent != SOURCE}
    assert packages - {"tissues", *BESIDE, *TOP} == set(FLOORS)


def test_nothing_imports_what_stands_beside() -> None:
    wrong = [
        f"{path.relative_to(CHECKOUT)} imports {name}"
        for path, name in imports()
        if name.startswith(tuple(f"handpipe.{b}" for b in (*BESIDE, *TOP)))
        and path.relative_to(SOURCE).parts[0] not in (name.split(".")[1], *TOP, "develop")
    ]
    assert wrong == []


def modules() -> dict[str, Path]:
    """Every module of the library by its dotted name; a package is its `__init__`."""
    dotted = {path: ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts) for path in PYTHON}
    return {name.removesuffix(".__init__"): path for path, name in dotted.items()}


def module_of(name: str, known: Mapping[str, Path]) -> str | None:
    """The module that defines an imported name, behind the packages that pass it on."""
    if name in known:
        return name
    package, _, last = name.rpartition(".")
    if package not in known:
        return None
    passed_on = [other for other in imported(known[package]) if other.endswith(f".{last}")]
    if known[package].name == "__init__.py" and passed_on:
        return module_of(passed_on[0], known)
    return package


def entries(known: Mapping[str, Path]) -> set[str]:
    """What users and the workflow begin with: scripts, commands, generators, layers, examples."""
    names = [name for path in (CHECKOUT / "workflow").rglob("*.py") for name in imported(path)]
    rules = [CHECKOUT / "Snakefile", *(CHECKOUT / "workflow").rglob("*.smk")]
    for path in (*rules, CHECKOUT / "README.md", *(CHECKOUT / "docs").rglob("*.md")):
        text = path.read_text(encoding="utf-8")
        lines = r"^from (handpipe[.\w]*) import (\([^)]*\)|.*)$"
        for module, found in re.findall(lines, text, re.MULTILINE):
            names += [f"{module}.{name}" for name in re.findall(r"\w+", found)]
    names += [record.module for record in generators.GENERATORS.values() if record.module]
    names += [record.module for record in LAYERS.values()]
    commands = {n for n, p in known.items() if '__name__ == "__main__"' in p.read_text(encoding="utf-8")}
    commands.add("handpipe.core.faces")  # which every package begins with
    return commands | {found for name in names if (found := module_of(name, known))}


# Where numbers inside functions are no settings: formulas, units, file formats, looks, bounds of arguments.
NO_SETTINGS = re.compile(
    r"(core|cli|develop|evaluation|synthetic)/|fem/elements/|imaging/formats/|mesh/files/|.*/__main__.py"
    r"|fem/linear/(pardiso|superlu).py|tissues/tendons/rods/energies.py|hand/exports/export.py"
)


def is_plain(value: float) -> bool:
    """Whether a number needs no name: quarters up to ten, guards against rounding, a thousand in a unit."""
    return ((4 * value).is_integer() and value <= 10) or value <= 1e-6 or value == 1e3


def unnamed_numbers(path: Path) -> list[float]:
    """Numbers with a point inside the functions of a file; defaults of arguments have names."""
    found = []
    for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(function, ast.FunctionDef):
            inside = [node for statement in function.body for node in ast.walk(statement)]
            defaults = {id(n) for node in inside if isinstance(node, ast.arguments) for n in ast.walk(node)}
            numbers = [node for node in inside if isinstance(node, ast.Constant) and id(node) not in defaults]
            found += [number.value for number in numbers if isinstance(number.value, float)]
    return found


def test_numbers_that_results_depend_on_have_names() -> None:
    """A number in the middle of a function has neither a unit nor a meaning (docs: Settings)."""
    names = {path.relative_to(SOURCE).as_posix(): path for path in PYTHON}
    unnamed = {
        name: [value for value in unnamed_numbers(path) if not is_plain(value)]
        for name, path in names.items()
        if not NO_SETTINGS.match(name)
    }
    assert {name: values for name, values in unnamed.items() if values} == {}


def test_the_contact_toolkit_is_imported_with_one_thread() -> None:
    direct = [path.name for path, name in imports() if name.partition(".")[0] == "ipctk"]
    assert direct == ["contact_toolkit.py"]


def test_no_modules_import_one_another_in_a_circle() -> None:
    """Imports inside functions and under TYPE_CHECKING count: a circle that these hide is a circle."""
    known = modules()
    below = {
        name: {m for other in imported(path) if (m := module_of(other, known))} - {name}
        for name, path in known.items()
    }
    try:
        graphlib.TopologicalSorter(below).prepare()
    except graphlib.CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_no_module_of_the_library_is_imported_for_types_alone() -> None:
    """Faces do so: their names load nothing until they are asked for."""
    found = []
    for path in PYTHON:
        if is_face(path):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
                lines = [
                    ast.unparse(inner)
                    for inner in ast.walk(node)
                    if isinstance(inner, ast.ImportFrom | ast.Import)
                ]
                found += [f"{path.relative_to(CHECKOUT)}: {line}" for line in lines if "handpipe" in line]
    assert found == []


def test_no_module_is_for_tests_or_benchmarks_alone() -> None:
    known = modules()
    reached, left = set[str](), list(entries(known))
    while left:
        name = left.pop()
        if name not in reached:
            reached.add(name)
            left += [m for other in imported(known[name]) if (m := module_of(other, known))]
    unused = {name for name, path in known.items() if path.name != "__init__.py"} - reached
    assert unused == set()


def test_snakemake_and_gmsh_stay_outside() -> None:
    found = {(path.relative_to(SOURCE).as_posix(), name.split(".")[0]) for path, name in imports()}
    assert {path for path, name in found if name == "snakemake"} == set()
    assert {path for path, name in found if name == "gmsh"} == {"mesh/generation/gmsh_process.py"}


def rules() -> dict[str, str]:
    """Every rule that runs a script, with its text."""
    found = {}
    for path in sorted((CHECKOUT / "workflow" / "rules").glob("*.smk")):
        for part in re.split(r"^rule ", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
            found[part.split(":")[0]] = part
    return found


@pytest.mark.parametrize("rule", rules())
def test_every_rule_says_what_it_needs_and_leaves(rule: str) -> None:
    text = rules()[rule]
    fields = set(re.findall(r"^    (\w+):", text, re.MULTILINE))
    assert fields >= {"output", "log", "benchmark", "threads", "resources", "message", "script"}
    assert "mem_mb=" in text
    assert "runtime=" in text


def test_paths_of_a_build_are_written_in_one_module() -> None:
    files = [CHECKOUT / "Snakefile", *(CHECKOUT / "workflow").rglob("*.smk")]
    lines = {
        f"{path.relative_to(CHECKOUT)}: {line.strip()}"
        for path in files
        for line in path.read_text(encoding="utf-8").splitlines()
        if "results/" in line
    }
    assert lines == set()


def test_every_script_has_its_rule() -> None:
    named = set(re.findall(r"scripts/(\w+)\.py", "".join(rules().values())))
    scripts = {
        path.stem
        for path in (CHECKOUT / "workflow" / "scripts").glob("*.py")
        if "with stage(snakemake)" in path.read_text(encoding="utf-8")
    }
    assert scripts == named
