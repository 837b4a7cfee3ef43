"""A person from a template: feature points, photographs, warps, families of sizes."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.anatomy.person.bony_points import bony_feature_points
    from handpipe.anatomy.person.subject_template import (
        SubjectTemplate,
        TemplateJoint,
        TemplateMuscle,
        TemplateTendon,
    )
else:
    __getattr__ = face(__name__)

__all__ = ["SubjectTemplate", "TemplateJoint", "TemplateMuscle", "TemplateTendon", "bony_feature_points"]
