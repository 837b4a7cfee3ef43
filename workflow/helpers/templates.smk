# Templates of organs, and those of the template hand that are carried onto a subject.

from handpipe.core import paths


def template_files(subject):
    """The subject's templates: the generated folder, or the files that the dataset names."""
    data = dataset(subject)
    if data.generator:
        return [data.path("templates")]
    organs = [*data.muscles.values(), *data.ligaments.values()]
    files = [o.template for o in organs] + [o.attachments for o in organs]
    files += [o.landmarks for o in organs if o.landmarks]
    files += [b.template for b in data.bones.values() if b.template]
    return [data.path(f) for f in files]


def is_carried(subject):
    """Whether axis hints, tendons' paths and nails are given in the frame of the templates."""
    return dataset(subject).drawn_in == "template"


def carried_template(wildcards):
    """Input function: what was carried onto the subject's bones, where the subject needs it."""
    if not is_carried(wildcards.subject):
        return []
    return paths.at(paths.CARRIED_TEMPLATE, subject=wildcards.subject)


def carried_files(wildcards):
    """Input function: what is carried, and the templates of bones that carry it."""
    data = dataset(wildcards.subject)
    files = [b.template for b in data.bones.values() if b.template]
    files += [t.path for t in data.tendons.values()]
    files += [n.surface for n in data.nails.values()]
    return [data.path(f) for f in files]


def nail_files(subject):
    """The nails' patches: the generated folder, or the files that the dataset names; none that are carried."""
    data = dataset(subject)
    if is_carried(subject):
        return []
    if data.generator and generator(subject).truth is not None:
        return [data.path("templates")]
    return [data.path(nail.surface) for nail in data.nails.values()]


def curve_folder(subject, path):
    """A clicked curve: inside the generated folder, or a file of its own; none where it is carried."""
    data = dataset(subject)
    if is_carried(subject):
        return []
    return data.path("curves") if data.generator else data.path(path)


def painted_regions(subject, fascia):
    """Regions that a person painted on a fascia, in place of those found from geometry."""
    data = dataset(subject)
    return data.path(data.regions[fascia]) if fascia in data.regions else []


def has_organs(subject):
    """Whether the subject has organs, which are fitted in every pose."""
    data = dataset(subject)
    return bool(data.tendons or data.muscles or data.ligaments)
