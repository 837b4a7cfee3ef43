"""Simulated muscles against truth; penetration after separation; inverted tets."""

from common import stage
from figures import contact_figures, stage_cost

with stage(snakemake):
    from pathlib import Path

    import numpy as np

    from handpipe import metrics
    from handpipe.config import Role, load_dataset
    from handpipe.evaluation.surfaces import penetration, symmetric_distance
    from handpipe.fem import plasticity
    from handpipe.hand.frames import read_frames
    from handpipe.mesh.surface import Surface, each_moved
    from handpipe.mesh.tetrahedra import TetMesh
    from handpipe.muscles.muscle import Muscle
    from handpipe.muscles.separation import load_surfaces
    from handpipe.skeleton.bones import read_registration
    from handpipe.skeleton.rig import Rig
    from muscle_files import read_guesses
    from truth import true_pose

    dataset = load_dataset(snakemake.input.dataset)
    rig = Rig.load(snakemake.input.rig)
    base = Path("results") / snakemake.wildcards.subject
    muscles = [Muscle.load(path) for path in snakemake.input.muscles]
    figures = stage_cost(
        snakemake,
        "place_templates",
        "extract_muscle",
        "separate_neutral",
        "extract_muscle_shapes",
        "separate_muscles",
        "fit_muscle_strains",
    )
    depths = []
    for pose, path in zip(dataset.examples, snakemake.input.separated, strict=True):
        surfaces = load_surfaces(path)
        transforms = read_registration(base / f"registration/{pose}.h5")
        bones = each_moved(rig.surfaces, transforms)
        for muscle in muscles:
            free = np.delete(surfaces[muscle.name].vertices, muscle.body.held, axis=0)
            others = [s for n, s in surfaces.items() if n != muscle.name]
            depths += [penetration(free, other).max() for other in (*bones.values(), *others)]
    figures["penetration_max"] = (float(max(depths)), "mm")
    eigenvalues = np.concatenate(
        [plasticity.eigenvalues(plasticity.exp(m.logs.reshape(-1, 6))) for m in muscles]
    )
    figures["strain_eigenvalue_min"] = (float(eigenvalues.min()), "1")
    figures["strain_eigenvalue_max"] = (float(eigenvalues.max()), "1")

    def true_surfaces(pose):
        """The truth's muscles in a pose, in its own frame."""
        found = true_pose(dataset, pose)["muscles"]
        return {name: Surface(found[name]["vertices"], found[name]["triangles"]) for name in dataset.muscles}

    if dataset.truth is not None:
        true = true_surfaces(dataset.neutral)
        placed = {n: g.surface for n, g in read_guesses(snakemake.input.templates, dataset.muscles).items()}
        fitted = {m.name: m.body.surface for m in muscles}
        for surfaces, name in ((placed, "template_error"), (fitted, "neutral_error")):
            found = [symmetric_distance(surfaces[n], true[n]) for n in true]
            figures |= metrics.summary(name, np.concatenate(found), "mm")

    errors, inverted, volumes, contacts = {Role.example: [], Role.heldout: []}, 0, [], []
    for path in snakemake.input.inner:
        [(frame, layers)] = read_frames(path)
        root = rig.poses[frame.name].root
        contacts.append(layers["muscles"][muscles[0].name].figures)
        true = {} if dataset.truth is None else true_surfaces(frame.name)
        for muscle in muscles:
            tets = layers["muscles"][f"{muscle.name}_mesh"]
            ratios = TetMesh(tets.vertices, tets.cells).volumes()
            inverted += int((ratios <= 0).sum())
            volumes.append(abs(ratios.sum() / TetMesh(tets.rest, tets.cells).volumes().sum() - 1) * 100)
            if muscle.name not in true:
                continue
            shape = layers["muscles"][muscle.name]
            there = true[muscle.name].moved(root.inverse()(true[muscle.name].vertices))
            found = symmetric_distance(Surface(shape.vertices, shape.cells), there)
            errors[dataset.poses[frame.name].role].append(found)
    figures |= contact_figures(contacts)
    figures["inverted_tets"] = (inverted, "1")
    figures["volume_change_max"] = (float(max(volumes)), "%")
    for role, prefix in ((Role.example, ""), (Role.heldout, "heldout_")):
        if errors[role]:
            figures |= metrics.summary(f"{prefix}surface_error", np.concatenate(errors[role]), "mm")
    metrics.write(snakemake.output[0], figures)
