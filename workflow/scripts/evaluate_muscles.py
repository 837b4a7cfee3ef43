"""Simulated muscles against truth; penetration after separation; inverted tets."""

import json

from common import dataset_of, stage
from figures import contact_figures, stage_cost

PREFIXES = {"example": "", "heldout": "heldout_"}

with stage(snakemake):
    from pathlib import Path

    import numpy as np

    from handpipe import artifacts, metrics
    from handpipe.evaluation.muscles import deepest, error_rows, surface_errors
    from handpipe.fem import plasticity
    from handpipe.hand.frames import read_frames
    from handpipe.mesh.surface import Surface, each_moved
    from handpipe.mesh.tetrahedra import TetMesh
    from handpipe.muscles.muscle import Muscle
    from handpipe.muscles.separation import load_surfaces
    from handpipe.skeleton.bones import read_registration
    from handpipe.skeleton.rig import Rig
    from muscle_files import read_guesses
    from truth import surfaces_in, true_pose

    dataset = dataset_of(snakemake)
    rig = Rig.load(snakemake.input.rig)
    base = Path("results") / snakemake.wildcards.subject
    muscles = {m.name: m for m in map(Muscle.load, snakemake.input.muscles)}
    figures = stage_cost(
        snakemake,
        "place_templates",
        "extract_muscle",
        "separate_neutral",
        "extract_muscle_shapes",
        "separate_muscles",
        "fit_muscle_strains",
    )
    held = {name: muscle.body.held for name, muscle in muscles.items()}
    depths = []
    for pose, path in zip(dataset.examples, snakemake.input.separated, strict=True):
        bones = each_moved(rig.surfaces, read_registration(base / f"registration/{pose}.h5"))
        depths.append(deepest(load_surfaces(path), held, bones.values()))
    figures["penetration_max"] = (max(depths), "mm")
    eigenvalues = np.concatenate(
        [plasticity.eigenvalues(plasticity.exp(m.logs.reshape(-1, 6))) for m in muscles.values()]
    )
    figures["strain_eigenvalue_min"] = (float(eigenvalues.min()), "1")
    figures["strain_eigenvalue_max"] = (float(eigenvalues.max()), "1")

    errors, inverted, volumes, contacts = {}, 0, [], []
    for path in snakemake.input.inner:
        [(frame, layers)] = read_frames(path)
        shapes = layers["muscles"]
        contacts.append(shapes[next(iter(muscles))].figures)
        for name in muscles:
            tets = shapes[f"{name}_mesh"]
            ratios = TetMesh(tets.vertices, tets.cells).volumes()
            inverted += int((ratios <= 0).sum())
            volumes.append(abs(ratios.sum() / TetMesh(tets.rest, tets.cells).volumes().sum() - 1) * 100)
        if dataset.truth is not None:
            home = rig.poses[frame.name].root.inverse()
            simulated = {name: Surface(shapes[name].vertices, shapes[name].cells) for name in muscles}
            true = surfaces_in(true_pose(dataset, frame.name)["muscles"])
            there = {name: surface.moved(home(surface.vertices)) for name, surface in true.items()}
            errors[frame.name] = surface_errors(simulated, there)
    figures |= contact_figures(contacts)
    figures["inverted_tets"] = (inverted, "1")
    figures["volume_change_max"] = (float(max(volumes)), "%")
    for role, prefix in PREFIXES.items():
        found = [d for pose, e in errors.items() if dataset.poses[pose].role == role for d in e.values()]
        if found:
            figures |= metrics.summary(f"{prefix}surface_error", np.concatenate(found), "mm")

    if dataset.truth is not None:
        true = surfaces_in(true_pose(dataset, dataset.neutral)["muscles"])
        placed = {n: g.surface for n, g in read_guesses(snakemake.input.templates, dataset.muscles).items()}
        fitted = {name: muscle.body.surface for name, muscle in muscles.items()}
        for shapes, name in ((placed, "template_error"), (fitted, "neutral_error")):
            found = surface_errors(shapes, true)
            figures |= metrics.summary(name, np.concatenate([*found.values()]), "mm")
        errors = {dataset.neutral: found} | errors
    roles = {pose: dataset.poses[pose].role.value for pose in errors}
    artifacts.write_text(snakemake.output.table, json.dumps(error_rows(errors, roles), indent=2))
    metrics.write(snakemake.output.metrics, figures)
