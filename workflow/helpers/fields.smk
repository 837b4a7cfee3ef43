# Parameters of rules: the fields of datasets and scenes that their scripts read.

import functools

from handpipe.core import LAYERS
from handpipe.core.configuration import selection


@functools.cache
def selected(of, subject, fields, names):
    """Fields of a dataset as text: a parameter of rules, of which their script makes the dataset."""
    return selection.select(of(subject), fields, **dict(names))


def reads(*fields, of=dataset):
    """Parameter function: the fields of the dataset that the rule's script reads, and no others.

    Fields are those of `handpipe.core.configuration.selection`; wildcards stand in braces, and {neutral},
    {examples} and {proposed} for the names of such poses. A change of another field does not rerun the rule.
    """

    def values(wildcards):
        data = of(wildcards.subject)
        names = {
            **dict(wildcards.items()),
            "neutral": data.neutral,
            "examples": tuple(data.examples),
            "proposed": tuple(proposed_poses(wildcards.subject)),
        }
        return selected(of, wildcards.subject, fields, tuple(names.items()))

    return values


def reads_whole(*fields):
    """As `reads`, of all that the subject has, whatever part of it the scenes model."""
    return reads(*fields, of=whole_dataset)


def image_of(pose="{pose}"):
    """Fields of the dataset that `pose_volume` reads of a pose."""
    return ["root", *(f"poses.{pose}.{part}" for part in ("volume", "series", "echo"))]


def of_labels(wildcards):
    """Parameter function: the fields that merging the labels of a pose reads; joints, too, in neutral."""
    fields = [
        *image_of(),
        "bones.*.label",
        "other_labels",
        "contrast",
        "neutral",
        "poses.{pose}.scribbles",
        "poses.{pose}.labels_show",
    ]
    if wildcards.pose == neutral(wildcards.subject):
        fields += ["joints.*.parent", "joints.*.child", "joints.*.angles"]
    return reads(*fields)(wildcards)


def reads_with_channels(*fields):
    """As `reads`, and the pose's channels where the bones' look is learned from them."""

    def values(wildcards):
        learned = dataset(wildcards.subject).contrast == "learned"
        return reads(*fields, *(["poses.{pose}.channels"] if learned else []))(
            wildcards
        )

    return values


def reads_with_maps(poses, *fields):
    """As `reads`, and what the reading of muscles in label maps needs where one of the poses has a map.

    poses: names of poses by subject.
    """

    def values(wildcards):
        data = dataset(wildcards.subject)
        if all(data.poses[pose].labels is None for pose in poses(data)):
            return reads(*fields)(wildcards)
        names = ("bones.*.label", "other_labels", "muscles.names")
        return reads(*fields, *names)(wildcards)

    return values


def reads_scene(*fields):
    """Parameter function: the same of the fields of a scene."""
    return lambda w: selection.select(scene(w.scene), fields)


def layer_fields(layers):
    """What the loading of layers reads of the dataset."""
    return [field for layer in layers for field in LAYERS[layer].fields]


def of_layers(layers, *further):
    """Parameter function: the fields of the dataset that a simulation of layers reads, and further ones.

    layers: names of the layers by wildcards.
    """
    return lambda w: reads(*further, *layer_fields(layers(w)))(w)


def reads_registered(*fields):
    """As `reads`, and what the reading of the images needs where they refine the registration."""

    def values(wildcards):
        if dataset(wildcards.subject).registration != "images":
            return reads(*fields)(wildcards)
        return reads(*fields, *image_of("{neutral}"), *image_of())(wildcards)

    return values
