"""Which layers of which frames are computed, at which level, and what is written of them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from handpipe.core.configuration.loading import load_yaml
from handpipe.core.configuration.model import Fidelity, Model, Name
from handpipe.core.layer_registry import needed, organs

LEARNED_LEVELS = ("L0", "L1")  # of a scene: from the simulated frames of another one
LAYERS_AT = {"L2": ("bones", "muscles", "skin"), "L3": ("bones", "skin")}  # that a level has
WITHOUT_TETS = ("L0", "L1", "L2")


class Recording(Model):
    """Which part of a recording of tracked points a scene plays, and how its noise is filtered."""

    side: Literal["right", "left"] | None = Field(
        None, description="hand that is followed, mirrored if it is the other; by default the subject's"
    )
    rate: float = Field(24.0, gt=0, le=1000, description="frames of the scene a second of the recording")
    start: float = Field(0.0, ge=0, description="of the first frame: s after the hand's first row")
    count: int | None = Field(None, ge=1, description="number of frames; by default all")
    smooth: float = Field(0.03, ge=0, le=1, description="standard deviation in s of the Gaussian filter")
    bridge: float = Field(0.25, ge=0, le=5, description="longest gap in s that is bridged")


class Scene(Model):
    """Which layers, which frames. `skin` without `fat` is one soft tissue around the bones (Wang 2019)."""

    layers: tuple[str, ...]
    frames: Path = Field(
        description="CSV of joint angles in degrees, one frame a row, or of keyframes; BVH; hand landmarks "
        "(JSON, CSV); targets of inverse kinematics or random poses (YAML); contractions of muscles "
        "(CSV); a recording of tracked points (CSV)"
    )
    recording: Recording | None = Field(
        None, description="of tracked points in `frames`; the scene is skipped where that file is absent"
    )
    bones: dict[Name, str] = Field(
        {}, description="bone -> name of its joint in a BVH file, where the two differ"
    )
    only: tuple[Name, ...] | None = Field(
        None, min_length=1, description="bones or fingers that are modelled, with the bones that carry them"
    )
    chunk: int = Field(4, ge=1, description="frames in one job")
    follow: bool = Field(
        False,
        description="start each frame from the one before: about half the time; frames then depend on those "
        "before, and the jobs run one after another",
    )
    viscosity: float = Field(
        0.0,
        ge=0,
        description="s; retardation time of soft tissues in frames that `follow` one another, 24 a second: "
        "folds then give way over some frames instead of within one",
    )
    obj: bool = Field(False, description="write the frames as a sequence of OBJ files, too")
    rigged: bool = Field(
        False, description="write a glTF with skeleton, skin weights and corrective shapes, too"
    )
    scan: bool = Field(
        False, description="write the neutral scan, with its texture, as the skin carries it as a glTF, too"
    )
    delta_mush: int = Field(
        0,
        ge=0,
        le=100,
        description="times that the skin which carries the scan is smoothed on its dorsal side",
    )
    skeleton: bool = Field(
        False, description="write the skeleton with its tendons as models of MuJoCo and OpenSim, too"
    )
    mechanics: bool = Field(
        False, description="write strains, stresses, fibre stretch and contact pressure as VTU, too"
    )
    deviations: bool = Field(
        False, description="state how far each point is expected to be off, as an artifact and as VTU, too"
    )
    muscle_barrier: bool = Field(
        False,
        description="keep muscles out of bones, of one another and themselves: 4 to 6 times their time",
    )
    equilibria: bool = Field(
        False,
        description="look for other equilibria of frames from other starts: at least twice the time of fat",
    )
    movie: bool = Field(False, description="draw the frames as movies, too; with `images` also the volumes")
    images: bool = Field(False, description="move the neutral image with the frames, and into scanned poses")
    fidelity: Fidelity | None = Field(
        None, description="the fidelity that it is made for; a build of another one is refused"
    )
    level: Literal["L0", "L1", "L2", "L3", "full"] = Field(
        "full",
        description="`full` simulates; L0 skins, L1 adds correctives, both learned from `learned`; L2 has "
        "muscles that bulge and a skin of springs; L3 simulates one soft tissue with creases",
    )
    learned: str | None = Field(
        None, description="scene whose simulated frames `level` L0 or L1 is learned from"
    )

    @model_validator(mode="after")
    def _learned(self) -> Scene:
        if (self.level in LEARNED_LEVELS) != (self.learned is not None):
            raise ValueError("learned: names a scene of random poses, with `level` L0 or L1 and only then")
        if self.level in WITHOUT_TETS and (self.mechanics or self.equilibria):
            raise ValueError(f"level: {self.level} has no tets: neither mechanics nor equilibria of them")
        if self.level in WITHOUT_TETS and self.follow:
            raise ValueError(f"follow: frames of level {self.level} do not start from others")
        if self.viscosity and not self.follow:
            raise ValueError("viscosity: counts from frame to frame, with `follow: true` alone")
        if self.level != "full" and self.deviations:
            raise ValueError(f"level: {self.level} has errors of its own: deviations are of `full` alone")
        if self.level == "L3" and self.equilibria:
            raise ValueError(
                "level: L3 bends from neutral: it has no other starts, and no equilibria of them"
            )
        return self

    @model_validator(mode="after")
    def _at_its_level(self) -> Scene:
        if self.level not in LAYERS_AT:
            return self
        known = LAYERS_AT[self.level]
        further = [layer for layer in self.layers if layer not in known]
        if further or (self.level == "L2" and self.images):
            wrong = f"has no {', '.join(further)}" if further else "moves no images"
            raise ValueError(f"level: {self.level} {wrong}; its layers are {', '.join(known)}")
        return self

    @model_validator(mode="after")
    def _known(self) -> Scene:
        known = organs()
        for layer in self.layers:
            if layer not in known:
                raise ValueError(f"layers: {layer!r} is not a layer; the layers are {', '.join(known)}")
        if self.images and not {"fat", "skin"} & set(self.needed):
            raise ValueError("images: need fat or skin among the layers: the skin bounds the moved image")
        if self.scan and not {"fat", "skin"} & set(self.needed):
            raise ValueError("scan: needs fat or skin among the layers: the skin carries it")
        if self.delta_mush and not self.scan:
            raise ValueError("delta_mush: smooths what carries the scan: add `scan: true`")
        if self.muscle_barrier and "muscles" not in self.needed:
            raise ValueError("muscle_barrier: needs muscles among the layers: it keeps these alone apart")
        if self.viscosity and not {"muscles", "ligaments", "fat", "skin"} & set(self.needed):
            raise ValueError(
                "viscosity: needs muscles, ligaments, fat or skin among the layers: it is theirs"
            )
        if self.equilibria and self.viscosity:
            raise ValueError("equilibria: a viscous tissue is at none while it moves: leave out `viscosity`")
        if self.equilibria and not {"fat", "skin"} & set(self.needed):
            raise ValueError("equilibria: need fat or skin among the layers: they are sought for these alone")
        return self

    @property
    def needed(self) -> list[str]:
        """The scene's layers and all that they need, inside out."""
        return needed(self.layers)


def load_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : path
        YAML file of the scene.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        As `load_yaml`.
    """
    return load_yaml(path, Scene)
