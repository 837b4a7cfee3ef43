# What is given or made of each muscle.


def of_muscles(pattern):
    """Input function: a pattern over the subject's muscles."""
    return lambda w: expand(
        pattern, muscle=dataset(w.subject).muscles, allow_missing=True
    )


def of_muscle(field):
    """Input function: hand-placed markers or landmarks of one muscle in neutral, where the dataset has them."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        path = getattr(data.poses[data.neutral], field).get(wildcards.muscle)
        return [] if path is None else data.path(path)

    return files


def labels_of_muscle(wildcards):
    """Input function: the label map of neutral, where it holds the muscle."""
    data = dataset(wildcards.subject)
    held = in_label_map(wildcards.subject, data.neutral)
    return (
        data.path(data.poses[data.neutral].labels) if wildcards.muscle in held else []
    )


def labels_of_examples(wildcards):
    """Input function: the label maps of the example poses, in their order."""
    data = dataset(wildcards.subject)
    maps = [data.poses[pose].labels for pose in data.examples]
    return [data.path(file) for file in maps if file is not None]


def all_of_muscles(field):
    """Input function: the same of all muscles in the example poses."""

    def files(wildcards):
        data = dataset(wildcards.subject)
        return [
            data.path(path)
            for pose in data.examples
            for path in getattr(data.poses[pose], field).values()
        ]

    return files
