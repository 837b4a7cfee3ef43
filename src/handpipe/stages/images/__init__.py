"""Images, seeds and bones: segmentation of scanned poses."""
