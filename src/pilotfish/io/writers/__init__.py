"""Writers of demonstrations for other programs: one module per format."""
