"""An example to begin with: a toy leg's skin and bones, and some of its muscles as curves."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from handpipe.core import InputError, write_text
from handpipe.mesh.files import write_surface
from handpipe.synthetic.geometry import leg_surfaces

CURVES = "leg.yaml"


def write_example(folder: Path) -> list[Path]:
    """Write skin.ply, bones/NAME.ply and leg.yaml.

    Parameters
    ----------
    folder : Path
        New or empty folder.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    InputError
        Where the folder has files.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "folder", "is not empty", "Name a new folder")
    skin, bones = leg_surfaces()
    surfaces = {folder / "skin.ply": skin}
    surfaces |= {folder / "bones" / f"{name}.ply": bone for name, bone in bones.items()}
    for path, surface in surfaces.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_surface(path, surface)
    text = files("handpipe.synthetic.geometry").joinpath("leg.yaml").read_text(encoding="utf-8")
    write_text(folder / CURVES, text)
    return [*surfaces, folder / CURVES]
