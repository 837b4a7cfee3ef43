"""The base of all that a person writes, and the types of its fields."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Vector = tuple[float, float, float]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
Subject = Annotated[str, Field(pattern=r"^[a-z][a-z0-9-]*$")]
Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]  # mm
Fidelity = Literal["preview", "standard", "paper"]


class UndeclaredFieldError(Exception):
    """A stage reads a field that its rule does not declare, and whose change would not rerun it."""


class Model(BaseModel):
    """Base of all configuration models: immutable, without unknown fields or numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Called for missing attributes alone: a selection (`selection.select`) lacks fields."""
            if name in type(self).model_fields:
                kind = type(self).__name__
                raise UndeclaredFieldError(f"{kind}.{name} is not declared by the rule of this script")
            return super().__getattr__(name)
