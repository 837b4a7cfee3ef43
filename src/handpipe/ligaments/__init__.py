"""Joint ligaments: muscles without contact (000 section 4.1)."""
