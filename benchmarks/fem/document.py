"""The figures as Markdown between the markers of docs/benchmarks.md, and the drawings beside it."""

from __future__ import annotations

import math
from pathlib import Path

from handpipe.core import metrics, write_text
from handpipe.evaluation.benchmarks import BARS, Figures, error_figures, write_svg

BEGIN, END = "<!-- table: python -m benchmarks.fem -->", "<!-- end of table -->"
TWIST = {
    "tets": "tets",
    "unknowns": "unknowns",
    "seconds": "ours [s]",
    "linear_seconds": "in linear solves [s]",
    "skfem_seconds": "scikit-fem + pypardiso [s]",
    "skfem_linear_seconds": "in linear solves [s]",
    "ratio_skfem": "ratio",
    "overhead": "overhead",
    "difference": "difference [mm]",
    "one_step_seconds": "in one step [s]",
}
SCALING = {
    "unknowns": "unknowns",
    "seconds": "in all [s]",
    "share_linear": "share of linear solves",
    "newton_steps": "Newton steps",
    "factorisations": "factorisations",
    "hessian_seconds": "Hessian [s]",
    "analyse_seconds": "analysis [s]",
    "factorise_seconds": "factorisation [s]",
    "back_substitution_seconds": "back substitution [s]",
}


def write(source: Path, document: Path, folder: Path) -> None:
    """Renew the tables of `document` and the SVG files of `folder` from the figures in `source`."""
    figures = metrics.read(source)
    text = document.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    write_text(document, f"{before}{BEGIN}\n\n{tables(figures)}\n{END}{after}")
    draw(figures, folder)


def draw(figures: Figures, folder: Path) -> None:
    """Curves of error over seconds as SVG."""
    for study, figure in error_figures(figures).items():
        write_svg(folder / f"error-by-{study.replace(' ', '-')}.svg", figure)


def tables(figures: Figures) -> str:
    """All tables as Markdown."""
    chief = [[text, *_cell(figures, name)] for name, text in BARS.items() if name in figures]
    sizes = [name.removeprefix("twist_tets_") for name in figures if name.startswith("twist_tets_")]
    sizes.sort(key=lambda size: figures[f"twist_tets_{size}"][0])
    counts = sorted(int(n.removeprefix("scaling_unknowns_")) for n in figures if n.startswith("scaling_unkn"))
    parts = [
        _facts(figures),
        _table(["measure", "value", "unit"], chief),
        "### Twist\n",
        _rows(figures, "twist", TWIST, sizes),
        "### Scaling\n",
        _rows(figures, "scaling", SCALING, [str(c) for c in counts], "tets"),
        _exponents(figures),
    ]
    return "\n".join(parts)


def _facts(figures: Figures) -> str:
    def fact(name: str) -> object:
        return figures.get(name, ("?", ""))[0]

    versions = ", ".join(
        f"{name.removeprefix('version_')} {value}"
        for name, (value, _) in figures.items()
        if name.startswith("version_") and value
    )
    return (
        f"{fact('machine_processor')}, {fact('machine_cores')} cores, {fact('machine_threads')} threads, "
        f"{fact('machine_date')}; load of the last 15 minutes {_number(fact('machine_load_15min'))}; "
        f"{versions}.\n"
    )


def _rows(figures: Figures, prefix: str, columns: dict[str, str], keys: list[str], first: str = "") -> str:
    rows = [
        [*([key] if first else []), *(_cell(figures, f"{prefix}_{name}_{key}")[0] for name in columns)]
        for key in keys
    ]
    return _table([*([first] if first else []), *columns.values()], rows)


def _exponents(figures: Figures) -> str:
    names = [n for n in figures if n.startswith("exponent_") and not n.startswith("exponent_theory_")]
    rows = [["time of an equilibrium", _cell(figures, "cost_exponent")[0], ""]]
    rows += [
        [
            name.removeprefix("exponent_").replace("_", " "),
            _cell(figures, name)[0],
            _cell(figures, name.replace("exponent_", "exponent_theory_"))[0],
        ]
        for name in names
    ]
    return _table(["grows with unknowns to the power", "measured", "theory"], rows)


def _cell(figures: Figures, name: str) -> tuple[str, str]:
    value, unit = figures.get(name, (None, ""))
    return _number(value), unit


def _number(value: object) -> str:
    if not isinstance(value, int | float):
        return "" if value is None else str(value)
    if value == 0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:.0f}" if abs(value) >= 1000 or value == int(value) else f"{value:.3g}"
    return f"{value:.1e}" if math.isfinite(value) else str(value)


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"
