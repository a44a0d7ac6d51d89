"""Measures of basins, on maps of labels (grids) or on samples; one file a measure."""
