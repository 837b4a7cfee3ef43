"""The random walker of `handpipe.imaging` against scikit-image's, in regions of the phantom hand."""
