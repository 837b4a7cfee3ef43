"""File formats of volumes and label volumes, one module a format."""

__all__: list[str] = []
