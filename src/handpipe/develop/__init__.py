"""Commands for developers: comparison of builds, pages of results, pictures."""

__all__: list[str] = []
