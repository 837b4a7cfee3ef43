"""What comes of real scans, which have no truth: agreement between images of one thing."""
