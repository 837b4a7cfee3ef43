"""The simulation's layers from their artifacts."""

from pathlib import Path

from handpipe.fascia.fascia import Fascia
from handpipe.fascia.layer import FasciaLayer
from handpipe.fat.flesh import FleshLayer
from handpipe.fat.layer import FatStrains, TissueLayer
from handpipe.fat.tissue import Tissue
from handpipe.hand.frames import read_frames
from handpipe.layers import Frame
from handpipe.ligaments.layer import LigamentLayer
from handpipe.muscles.layer import MuscleLayer, known_surfaces
from handpipe.muscles.muscle import Muscle
from handpipe.skeleton.layer import BoneLayer
from handpipe.tendons.layer import TendonLayer
from handpipe.tendons.tendon import Tendon

INNER = ("bone_fascia", "tendons", "muscle_fascia", "ligaments")


def layers_of(names, rig, dataset, base):
    """Layers by name, inside out; a layer of which the subject has no member is left out."""
    base = Path(base)

    def members(kind, cls, pattern, given):
        return [cls.load(base / kind / pattern.format(name)) for name in given]

    made = []
    for name in names:
        if name == "bones":
            made.append(BoneLayer(rig.surfaces))
        elif name == "bone_fascia":
            made.append(FasciaLayer(Fascia.load(base / "fascia/bone.h5"), "bones"))
        elif name == "flesh" and dataset.fleshed:
            made.append(FleshLayer(Tissue.load(base / "soft_tissue/mesh.h5")))
        elif name == "tendons" and dataset.tendons:
            made.append(TendonLayer(members("tendons", Tendon, "{}/hooks.h5", dataset.tendons)))
        elif name == "muscles" and dataset.muscles:
            muscles = members("muscles", Muscle, "{}/strains.h5", dataset.muscles)
            made.append(MuscleLayer(muscles, examples=known_surfaces(muscles)))
        elif name == "muscle_fascia" and dataset.muscles:
            made.append(FasciaLayer(Fascia.load(base / "fascia/muscle.h5"), "muscles"))
        elif name == "ligaments" and dataset.ligaments:
            made.append(LigamentLayer(members("ligaments", Muscle, "{}.h5", dataset.ligaments)))
        elif name == "fat":
            made.append(fat_layer(base))
        elif name == "skin" and "fat" not in names:
            made.append(soft_tissue_layer(base))
    return made


def fat_layer(base, strains=True):
    """The fat with its strains, or without them (model m1 of Zheng 2022 Table 4)."""
    fitted = FatStrains.load(Path(base) / "fat/strains.h5")
    fitted = fitted if strains else fitted.without_strains()
    return TissueLayer("fat", INNER, Tissue.load(Path(base) / "fat/mesh.h5"), fitted)


def soft_tissue_layer(base):
    """One soft tissue around the bones (model m2 of Zheng 2022 Table 4, Wang 2019)."""
    return TissueLayer("skin", ("bones",), Tissue.load(Path(base) / "soft_tissue/mesh.h5"))


def flesh_in_poses(paths):
    """The flesh's shape in scanned poses, by pose."""
    frames = [read_frames(path)[0] for path in paths]
    return {frame.name: layers["flesh"]["flesh_mesh"] for frame, layers in frames}


def scanned_frame(rig, pose):
    """A scanned pose as the rig explains it, the root at rest."""
    bones = rig.scanned_bones(pose)
    return Frame(pose, rig.poses[pose].angles, bones)
