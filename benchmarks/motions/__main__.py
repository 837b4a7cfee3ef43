"""`python -m benchmarks.motions results/SUBJECT --output JSON`: what its build left of the five sequences.

A table is written beside the figures, with the ending .md. Sequences that were not simulated are named.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.motions.document import table
from benchmarks.motions.sequences import PUBLISHED, of_scene, together
from handpipe.core import artifacts, metrics


def main(arguments: Sequence[str] | None = None) -> None:
    """Gather the figures, print the table, and write both."""
    parser = argparse.ArgumentParser(prog="benchmarks.motions", description=__doc__)
    parser.add_argument("folder", type=Path, help="results of a subject")
    parser.add_argument("--scenes", nargs="+", choices=PUBLISHED, default=[*PUBLISHED], help="which of them")
    parser.add_argument("--output", type=Path, required=True, help="JSON of the figures")
    options = parser.parse_args(arguments)
    scenes = {scene: of_scene(options.folder, scene) for scene in options.scenes}
    found = together([*scenes.values()])
    for scene, own in scenes.items():
        found |= {f"{scene}_{name}": value for name, value in own.items()}
    options.output.parent.mkdir(parents=True, exist_ok=True)
    metrics.write(options.output, found)
    artifacts.write_text(options.output.with_suffix(".md"), table(scenes))
    print(table(scenes))
    for scene in PUBLISHED.keys() - scenes.keys():
        print(f"{scene} was not simulated")


if __name__ == "__main__":
    main()
