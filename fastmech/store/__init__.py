"""Result files: HDF5 that netCDF-4 readers open, written whole or not at all, read lazily."""
