"""A file of bones that is edited: each click through the skin is a point, and bones follow."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handpipe.anatomy.placing import (
    BoneFile,
    Library,
    bone_faults,
    load_bones,
    middle_inside,
    place_bones,
    read_library,
    write_bone_file,
)
from handpipe.anatomy.shipped import HAND
from handpipe.cli.muscle_curves.given import each_with, given_json, given_vector
from handpipe.cli.muscle_curves.packing import pack
from handpipe.cli.muscle_curves.session import copied_beside, curves_command, require_yaml, surface_arrays
from handpipe.cli.own_files import written_anew
from handpipe.core import InputError
from handpipe.core.configuration import checked
from handpipe.mesh.files import read_surface, write_surface
from handpipe.mesh.surfaces import Surface


class BoneSession:
    """Bones inside a skin, as a person places them.

    Parameters
    ----------
    target : Path
        File of the bones; it need not exist yet. Their surfaces are written to the folder of its name.
    skin : Surface
        Closed surface in mm.
    library : mapping of str to Surface
        Templates by name.
    skin_file : Path, optional
        File of the skin, for sentences.

    Raises
    ------
    InputError
        For a wrong file of bones.
    """

    def __init__(
        self, target: Path, skin: Surface, library: Library, skin_file: Path = Path("skin.ply")
    ) -> None:
        self.target, self.skin, self.library, self.skin_file = target, skin, library, skin_file
        self.file = load_bones(target) if target.is_file() else BoneFile.model_validate({"units": "mm"})
        self.kept: Path | None = None
        self.bones = place_bones(self.file, library, target)
        self.faults = bone_faults(self.file, self.bones, skin, target)

    @property
    def folder(self) -> Path:
        """Where surfaces of bones are written to."""
        return self.target.with_suffix("")

    def settings(self) -> dict[str, Any]:
        """What the page shows besides surfaces."""
        return {"title": self.target.stem, "file": str(self.target), "templates": list(self.library)}

    def surfaces(self) -> bytes:
        """The skin, packed."""
        return pack({}, surface_arrays({"skin": self.skin}))

    def edit(self, content: bytes) -> bytes:
        """Take the whole content of the file as the page has it, and answer with its bones, packed.

        Parameters
        ----------
        content : bytes
            JSON of a file of bones. A point may be a `ray` with `origin` and `direction`: it is the middle
            between where the ray enters and leaves the skin.

        Returns
        -------
        bytes
            Content without rays, faults, seconds; surfaces.

        Raises
        ------
        InputError
            For content that is wrong; the session then stays as it was.
        """
        start = time.perf_counter()
        file = checked(self.target, self._placed(given_json(self.target, content)), BoneFile)
        bones = place_bones(file, self.library, self.target)
        self.faults = bone_faults(file, bones, self.skin, self.target)
        self.file, self.bones = file, bones
        return self.state(time.perf_counter() - start)

    def state(self, seconds: float = 0.0) -> bytes:
        """The bones as they are, packed; with the seconds that an edit took."""
        named: dict[str, Surface] = {f"bone/{name}": bone for name, bone in self.bones.items()}
        header = {
            "content": self.file.model_dump(mode="json", exclude_unset=True),
            "bones": list(self.bones),
            "faults": [f"{fault.field}: {fault.problem}. {fault.remedy}" for fault in self.faults],
            "seconds": seconds,
        }
        arrays: dict[str, NDArray] = surface_arrays(named)
        return pack(header, arrays)

    def save(self) -> str:
        """Write file and surfaces; an earlier file is copied beside it once. Returns a sentence.

        Raises
        ------
        InputError
            The first fault of the bones, or where there is none; nothing is written then.
        """
        if self.faults:
            raise self.faults[0]
        if not self.bones:
            raise InputError(self.target, "bones", "there is none", "Place a bone first")
        if self.kept is None and self.target.is_file():
            self.kept = copied_beside(self.target)
        with written_anew(self.folder, "handpipe bones") as made:
            for name, bone in self.bones.items():
                write_surface(made / f"{name}.ply", bone)
        write_bone_file(self.target, self.file)
        kept = f"; the earlier file is {self.kept.name}" if self.kept else ""
        curves = self.target.with_name("curves.yaml")
        further = curves_command(curves, self.skin_file, self.folder)
        return f"saved {len(self.bones)} bones to {self.target} and {self.folder}{kept}. Next: {further}"

    def _placed(self, content: Any) -> Any:
        """The content with each ray as a point."""

        def middle(given: Mapping[str, Any]) -> Any:
            ray = given["ray"] if isinstance(given["ray"], dict) else {}
            origin, direction = (
                given_vector(self.target, f"ray.{part}", ray.get(part)) for part in ("origin", "direction")
            )
            return np.round(middle_inside(self.skin, origin, direction, self.target), 3).tolist()

        return each_with("ray", content, middle)


def open_bones(target: Path, skin: Path, folders: Sequence[Path] = ()) -> BoneSession:
    """The session of a file of bones inside a skin of a file.

    Parameters
    ----------
    target : Path
        File of the bones; it need not exist yet.
    skin : Path
        Closed surface in mm: PLY, STL or OBJ.
    folders : sequence of Path
        Folders of further templates.

    Returns
    -------
    BoneSession

    Raises
    ------
    InputError
        For missing or wrong files.
    """
    require_yaml(target)
    library = read_library(list(folders), HAND / "bones")
    return BoneSession(target, read_surface(skin, closed=True), library, skin)
