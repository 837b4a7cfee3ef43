"""The image model beside real gradient echoes: levels, spreads and edges of tissues.

Real regions are boxes placed by hand (`tests/data/tissue_regions.json`). The model images the phantom finger
with the series' times, voxels of about the hand's size in its plane and all effects but the coil's at usual
strength; its regions are the voxels that one tissue fills.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.images.subject import grid, posed
from handpipe.core import Array, Metrics, atomic
from handpipe.synthetic.acquisition import image
from handpipe.synthetic.acquisition.physics import Effects, scan
from handpipe.synthetic.acquisition.physics import Sequence as PulseSequence
from handpipe.synthetic.acquisition.posed import anatomy_of

REGIONS = Path(__file__).parents[2] / "tests" / "data" / "tissue_regions.json"
DATA = Path(__file__).parents[3] / "shared" / "data" / "real_mri"
SERIES = ("foot_dixon", "hand_dixon", "calf_dixon")
ECHOES = ("3.45", "4.60", "5.75")  # ms
END = 7.0  # mm of a bone's end
FINEST = 0.6  # mm of the model's voxels
TISSUES = ("marrow", "muscle", "fat", "air")
REPETITION, FLIP, FIELD = 23.0, 5.0, 3.0  # of the series: ms, degrees, T


@dataclass(frozen=True)
class Levels:
    """Values of each tissue over the mean of muscle, of one image.

    edge: voxels in which the signal rises from 10 % to 90 % of its first peak, from air into the skin.
    """

    series: str
    echo: str
    values: Mapping[str, Array]
    edge: float

    def mean(self, tissue: str) -> float:
        """Mean level."""
        return float(self.values[tissue].mean())

    def spread(self, tissue: str) -> float:
        """Standard deviation over the mean level; of air over muscle."""
        return float(self.values[tissue].std() / (1.0 if tissue == "air" else self.mean(tissue)))


def real(folder: Path = DATA) -> Iterator[Levels]:
    """The real images' levels, if the folder has them."""
    regions = json.loads(REGIONS.read_text(encoding="utf-8"))
    for series in SERIES:
        for echo, file in regions[series]["files"].items():
            path = folder / series / file
            if path.exists():
                image_file: Any = nibabel.load(path)
                volume = np.asarray(image_file.dataobj, dtype=np.float64)
                edges = [_box(volume, box) for box in regions[series]["edge"]]
                values = {t: _within(volume, regions[series][t]) for t in TISSUES}
                yield _levels(series, echo, values, edges)


def modelled(echo: str, spacing: float = FINEST) -> Levels:
    """The model's levels at an echo time in ms."""
    finger, voxels = posed(), grid(spacing)
    sequence = PulseSequence(FIELD, REPETITION, float(echo), FLIP)
    anatomy = anatomy_of(finger, voxels)
    values = scan(anatomy, voxels, sequence, Effects({"coil": "none"}, "usual"), [1, 0, 6]).astype(np.float64)
    edge = _box(values.transpose(0, 2, 1), _below(voxels))
    return _levels("model", echo, {t: values[m] for t, m in _pure(voxels).items()}, [edge])


def _below(voxels: image.VoxelGrid) -> list[int]:
    """Box across the palm's skin in the middle of the metacarpal, axes x, z, y."""
    nx, ny, nz = voxels.shape
    return [nx // 4, nx // 3, 0, nz // 2, ny // 2 - 2, ny // 2 + 3]


def _pure(voxels: image.VoxelGrid) -> dict[str, Array]:
    """Voxels deep inside a tissue; of marrow those at the bones' ends: most real boxes lie in such bone."""
    finger = posed()
    organs = {"muscle": finger.muscles, "marrow": finger.marrow}
    inside = {t: np.zeros(voxels.shape, bool) for t in organs}
    for tissue, surfaces in organs.items():
        for surface in surfaces.values():
            inside[tissue] |= image.signed_distance(surface, voxels, 2.0) < -1.2
    others = np.zeros(voxels.shape, bool)
    for group in (finger.bones, finger.muscles, finger.ligaments, finger.tendon_tubes):
        for surface in group.values():
            others |= image.signed_distance(surface, voxels, 2.0) < 1.5
    depth = image.signed_distance(finger.skin, voxels, 5.0)
    ends = np.zeros(voxels.shape, bool)
    x = voxels.origin[0] + voxels.spacing * np.arange(voxels.shape[0])
    for points, _ in finger.marrow.values():
        low, high = points[:, 0].min(), points[:, 0].max()
        ends[(x > low) & (x < high) & ((x < low + END) | (x > high - END))] = True
    return {
        "marrow": inside["marrow"] & ends,
        "muscle": inside["muscle"],
        "fat": (depth < -3.0) & ~others,
        "air": depth > 3.0,
    }


def _box(volume: Array, box: list[int]) -> Array:
    a, b, c, d, e, f = box
    return volume[a:b, c:d, e:f]


def _within(volume: Array, boxes: list[list[int]]) -> Array:
    return np.concatenate([_box(volume, box).ravel() for box in boxes])


def _levels(series: str, echo: str, values: Mapping[str, Array], edges: Sequence[Array]) -> Levels:
    muscle = float(values["muscle"].mean())
    widths = [
        edge_width(line) for edge in edges for line in np.moveaxis(edge, 1, 2).reshape(-1, edge.shape[1])
    ]
    over = {tissue: v / muscle for tissue, v in values.items()}
    return Levels(series, echo, over, float(np.median(widths)))


def edge_width(line: Array) -> float:
    """Voxels in which values (n,) rise from 10 % to 90 % between the first ones and their first peak.

    A peak is higher than a quarter of the largest value.
    """
    low = float(np.mean(line[:2]))
    start = int(np.argmax(line > low + 0.25 * (float(line.max()) - low)))
    falls = np.flatnonzero(np.diff(line[start:]) <= 0)
    high = float(line[start + falls[0]]) if len(falls) else float(line[-1])
    at = []
    for share in (0.1, 0.9):
        level = low + share * (high - low)
        above = int(np.argmax(line >= level))
        before = float(line[above - 1]) if above else low
        at.append(above - (float(line[above]) - level) / max(float(line[above]) - before, 1e-9))
    return at[1] - at[0]


def figures(levels: Sequence[Levels]) -> Metrics:
    """Tissue ratios of the model, and means of the real foot's and hand's, at each echo."""
    real_ones = [v for v in levels if v.series in ("foot_dixon", "hand_dixon")]
    found: Metrics = {}
    for tissue in ("marrow", "fat"):
        for model in (v for v in levels if v.series == "model"):
            same = [v.mean(tissue) for v in real_ones if v.echo == model.echo]
            if same:
                name = f"image_{tissue}_over_muscle_{model.echo.replace('.', '_')}"
                found |= {f"{name}_model": (model.mean(tissue), "1")}
                found |= {f"{name}_real": (float(np.mean(same)), "1")}
    return found


def table(levels: Sequence[Levels]) -> str:
    """The levels as a Markdown table."""
    lines = [
        "| image | echo [ms] | marrow / muscle | fat / muscle | air / muscle | spread of marrow "
        "| of muscle | of fat | skin's edge [voxels] |",
        "|" + " --- |" * 9,
    ]
    for v in levels:
        means = [f"{v.mean(t):.2f}" for t in ("marrow", "fat")] + [f"{v.mean('air'):.3f}"]
        spreads = [f"{v.spread(t):.2f}" for t in ("marrow", "muscle", "fat")]
        lines.append(f"| {v.series} | {v.echo} | " + " | ".join(means + spreads) + f" | {v.edge:.1f} |")
    return "\n".join(lines)


def draw(levels: Sequence[Levels], path: Path) -> None:
    """Histograms of each tissue's values over muscle's mean, one row an image, one column an echo."""
    rows, echoes = [*dict.fromkeys(v.series for v in levels)], [*dict.fromkeys(v.echo for v in levels)]
    figure = Figure(figsize=(10.0, 1.7 * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(echoes), sharex=True, squeeze=False)
    colours = dict(zip(TISSUES, ("tab:orange", "tab:red", "tab:olive", "0.5"), strict=True))
    for v in levels:
        axes = panels[rows.index(v.series), echoes.index(v.echo)]
        for tissue in TISSUES:
            bins = np.linspace(0.0, 2.8, 85)
            axes.hist(
                v.values[tissue],
                bins,
                density=True,
                histtype="stepfilled",
                alpha=0.55,
                color=colours[tissue],
                label=tissue,
            )
        axes.set_ylim(0.0, 6.0)
        axes.set_yticks([])
        axes.set_title(f"{v.series.replace('_', ' ')}, {v.echo} ms", fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("value over the mean of muscle", fontsize=8)
    panels[0, -1].legend(fontsize=7)
    FigureCanvasAgg(figure)
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=80)
