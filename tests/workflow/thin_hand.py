"""A hand of the coupled simulation in a minute: one muscle, one tendon, one nail, coarse tets and voxels."""

import re
from pathlib import Path
from typing import Any

import yaml

from .running import CHECKOUT

LIKE = "phantom-hand-complete"
ORGANS = {"muscles": ["dorsal_interosseous1"], "ligaments": [], "tendons": ["flexor2"], "nails": ["nail2"]}
EDGES = {"bone": 1.8, "skin": 2.8, "fat": 4}  # mm; with longer ones a joint opens through the skin
POSES = {"neutral": "neutral", "loose": "example", "flat": "heldout"}  # those that bend least
SPACING = 2.0  # mm
TRUTH_RULES = {  # that make its truth
    "coupled_body",
    "coupled_images",
    "coupled_pose",
    "coupled_templates",
    "evaluate_truth",
    "template_hand",
}


def thin_hand(name: str) -> dict[str, Any]:
    """What the dataset file of such a hand says."""
    like = yaml.safe_load((CHECKOUT / f"config/datasets/{LIKE}.yaml").read_text(encoding="utf-8"))
    organs = {kind: {organ: like[kind][organ] for organ in organs} for kind, organs in ORGANS.items()}
    poses = {
        pose: {"role": role, "volume": f"volumes/{pose}.nii.gz", "scan": f"scans/{pose}.ply"}
        for pose, role in POSES.items()
    }
    poses["neutral"]["seeds"] = "seeds/neutral.nii.gz"
    given = {"name": name, "like": LIKE, "root": f"results/{name}/data", "poses": poses}
    return given | organs | {"scanner": {"spacing": SPACING}}


def thin_out(folder: Path) -> None:
    """Leave the template hand of a working copy these organs, and make its meshes coarser."""
    file = folder / "config/anatomy/hand.yaml"
    hand = yaml.safe_load(file.read_text(encoding="utf-8"))
    for kind, names in ORGANS.items():
        hand[kind] = {name: hand[kind][name] for name in names}
    for muscle in hand["muscles"].values():
        muscle.pop("volume")  # takes minutes to be met
    file.write_text(yaml.safe_dump(hand, sort_keys=False), encoding="utf-8")
    rules = folder / "workflow/rules/anatomy.smk"
    text = rules.read_text(encoding="utf-8")
    text, count = re.subn(r"^HAND_EDGES = .*", f"HAND_EDGES = {EDGES}", text, flags=re.MULTILINE)
    assert count == 1
    rules.write_text(text, encoding="utf-8")
