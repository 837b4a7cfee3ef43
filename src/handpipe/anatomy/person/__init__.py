"""A person from a template: feature points, photographs, warps, families of sizes."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.person import feature_points
    from handpipe.anatomy.person.bony_points import bony_feature_points
    from handpipe.anatomy.person.family import lengths_of
    from handpipe.anatomy.person.person_at_rest import person_of_photograph, person_of_points
    from handpipe.anatomy.person.photograph import Photograph, read_photograph
    from handpipe.anatomy.person.subject_template import (
        SubjectTemplate,
        TemplateJoint,
        TemplateMuscle,
        TemplateTendon,
        scaled,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "Photograph",
    "SubjectTemplate",
    "TemplateJoint",
    "TemplateMuscle",
    "TemplateTendon",
    "bony_feature_points",
    "feature_points",
    "lengths_of",
    "person_of_photograph",
    "person_of_points",
    "read_photograph",
    "scaled",
]
