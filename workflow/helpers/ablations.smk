# Variants of the full model, and the files that each has of its own.

import functools

from handpipe.core import LAYERS, paths
from handpipe.stages.baselines.variants import VARIANTS


@functools.cache
def ablated_subjects():
    """Subjects that have every layer; others are named and left out."""
    kept = []
    for subject in buildable_subjects():
        data = dataset(subject)
        lacks = [name for name in ("tendons", "muscles") if not getattr(data, name)]
        if lacks:
            logger.warning(
                f"handpipe: {subject} has no ablations: it has no {' and no '.join(lacks)}"
            )
        else:
            kept.append(subject)
    return kept


def variants_of(subject):
    """Variants that the subject can have: true organs with a truth, no flesh where it has one."""
    data = dataset(subject)
    return [
        name
        for name, variant in VARIANTS.items()
        if (data.truth is not None or not variant.true)
        and (data.fleshed or "flesh" not in variant.without)
    ]


def ablated_layer_files(wildcards):
    """Input function: the artifacts of the layers that a variant simulates, its own where it has them."""
    variant, own = VARIANTS[wildcards.variant], paths.at(paths.ABLATION, **wildcards)
    full = paths.at(paths.SUBJECT, subject=wildcards.subject)
    return [
        own / path.relative_to(full) if layer in variant.refitted else path
        for layer in variant.loaded
        for path in layer_files(wildcards.subject, [layer])
    ]


def flesh_under_variant(wildcards):
    """Input function: the full model's flesh of a pose, where a layer of the variant needs it."""
    variant = VARIANTS[wildcards.variant]
    needs = any("flesh" in LAYERS[layer].needs for layer in variant.loaded)
    given = "flesh" not in (*variant.without, *variant.loaded)
    if needs and given and dataset(wildcards.subject).fleshed:
        return paths.at(
            paths.POSE_FLESH, subject=wildcards.subject, pose=wildcards.pose
        )
    return []


def of_variant(pattern, is_own):
    """Input function: a file of the variant where it has its own, else that of the full model."""
    return lambda w: (
        paths.ablated(pattern) if is_own(VARIANTS[w.variant]) else pattern
    )


def of_ablations(pattern):
    """Input function: a variant's file over all variants and scanned poses of the subject."""
    return lambda w: expand(
        paths.ablated(pattern),
        variant=variants_of(w.subject),
        pose=scanned(w.subject),
        allow_missing=True,
    )
