"""Generated subjects: templates, images, seeds and truth."""
