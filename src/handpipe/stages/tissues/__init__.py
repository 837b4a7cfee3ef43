"""Fascia, skin and fat: meshes, strains, comparison with scans."""
