"""A finger whose tissues slide on one another: bodies in contact, without friction."""

__all__: list[str] = []
