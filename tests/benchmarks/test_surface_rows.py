"""Every row of the readers' table of surfaces, tets, marks and attachments is right or refused."""

from benchmarks.trust.surface_rows import rows


def test_no_row_is_wrong() -> None:
    table = rows()
    assert len(table) >= 120
    assert [row for row in table if row.wrong] == []
