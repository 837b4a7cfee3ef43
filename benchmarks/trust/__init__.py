"""Whether a wrong result is ever handed on silently: counts over many scenes, files, edits and kills."""
