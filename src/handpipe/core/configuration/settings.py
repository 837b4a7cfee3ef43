"""What is built: the settings of a build, and the mesh sizes that its fidelity stands for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from handpipe.core.configuration.dataset import Interpolation
from handpipe.core.configuration.loading import checked
from handpipe.core.configuration.model import Fidelity, Length, Model, Subject
from handpipe.core.configuration.scene import Scene
from handpipe.core.errors import InputError


class Edges(Model):
    """Edge lengths in mm of all meshes of a build."""

    muscle: Length
    bone_fascia: Length
    muscle_fascia: Length
    tendon: Length
    skin: Length
    crease: Length
    fat: Length
    flesh: Length


EDGES: dict[Fidelity, Edges] = {
    "preview": Edges(
        muscle=2.5, bone_fascia=2.5, muscle_fascia=2.5, tendon=1.2, skin=2.5, crease=1.2, fat=4.0, flesh=4.0
    ),
    "standard": Edges(
        muscle=1.8, bone_fascia=1.5, muscle_fascia=1.5, tendon=1.2, skin=1.5, crease=0.8, fat=2.5, flesh=4.0
    ),
    # At least the numbers of vertices of Zheng 2022 Table 1, on the phantom hand (docs/fidelity.md).
    "paper": Edges(
        muscle=0.97,
        bone_fascia=0.65,
        muscle_fascia=0.66,
        tendon=0.44,
        skin=1.3,
        crease=0.5,
        fat=1.7,
        flesh=4.0,
    ),
}


class GivenEdges(Model):
    """Edge lengths in mm that replace those of the fidelity."""

    muscle: Length | None = Field(None, description="of the muscles' tetrahedra")
    fascia: Length | None = Field(None, description="of the triangles of both fasciae")
    bone_fascia: Length | None = Field(None, description="of the bone fascia's triangles, before `fascia`")
    muscle_fascia: Length | None = Field(None, description="of the muscle fascia's triangles, likewise")
    tendon: Length | None = Field(None, description="of the segments of the tendons' rods")
    skin: Length | None = Field(None, description="of the skin's triangles")
    crease: Length | None = Field(None, description="of the skin's triangles where it folds, of level L3")
    fat: Length | None = Field(None, description="of the tetrahedra of the fat and of the single soft tissue")
    flesh: Length | None = Field(None, description="of the flesh, which carries tendons and muscles")

    def in_place_of(self, edges: Edges) -> Edges:
        """These lengths where they are given, else those of `edges`."""
        given = self.model_dump(exclude_none=True)
        both = given.pop("fascia", None)
        if both is not None:
            given = {"bone_fascia": both, "muscle_fascia": both, **given}
        return edges.model_copy(update=given)


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


class Settings(Model):
    """What is built: config/config.yaml, with what the command line puts in its place."""

    subjects: Annotated[tuple[Subject, ...], BeforeValidator(_listed)]
    scenes: Annotated[tuple[str, ...], BeforeValidator(_listed)]
    fidelity: Fidelity = Field(description="sizes of all meshes; paper: those of Zheng 2022 Table 1")
    edges: GivenEdges = Field(
        default_factory=lambda: GivenEdges.model_validate({}),
        description="single edge lengths in mm, before the fidelity's",
    )
    interpolation: Interpolation = Field(description="of fat strains over poses")
    truth: Literal["toy", "full"] = Field(description="resolution of coupled simulations that make subjects")

    @property
    def sizes(self) -> Edges:
        """Edge lengths of all meshes."""
        return self.edges.in_place_of(EDGES[self.fidelity])

    @property
    def shown(self) -> dict[str, str]:
        """The settings as text, with the edge lengths in use."""
        content = self.model_dump(mode="json") | {"edges": self.sizes.model_dump()}
        return {key: str(value) for key, value in content.items()}


def settings_of(content: Any, source: str | Path = "config") -> Settings:
    """The settings in a configuration that Snakemake merged.

    Parameters
    ----------
    content : mapping
        The merged configuration.
    source : path
        Where it comes from, for error texts.

    Returns
    -------
    Settings

    Raises
    ------
    InputError
        Where a key is wrong or missing; it names the first one.
    """
    return checked(source, content, Settings)


def require_fidelity(source: str | Path, scene: Scene, settings: Settings) -> None:
    """Refuse a scene that asks for another fidelity than the build has.

    Parameters
    ----------
    source : path
        File of the scene, for the error's text.
    scene : Scene
        The scene.
    settings : Settings
        The build's settings.

    Raises
    ------
    InputError
        Where the scene names another fidelity than the settings.
    """
    if scene.fidelity not in (None, settings.fidelity):
        problem = f"is {scene.fidelity}, but the build's is {settings.fidelity}: a subject's folder has one"
        remedy = f"Build it in a folder of its own with --config fidelity={scene.fidelity}, or drop the field"
        raise InputError(source, "fidelity", problem, remedy)
