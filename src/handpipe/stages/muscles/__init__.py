"""Muscles and ligaments: templates, shapes, separation, strains."""
