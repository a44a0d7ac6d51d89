"""The layout of a result file and the names it rests on.

A result file is an HDF5 file that netCDF-4 readers open:

- The root holds the scene's parameters: one float64 scalar for each, with `units` and `long_name`.
- Each section of the request is a group of the root and holds one `fastmech.results.Dataset`, whose groups
  are groups within: the curves and the table of sheets of a map.
- A variable is an HDF5 dataset with the attributes `units` and `long_name` and any others of its own. Its
  dimensions are HDF5 dimension scales of the same group: the coordinate variable of that name or, where
  there is none, an empty dataset with netCDF's own mark (`DIMENSION_ONLY`). They are attached as HDF5 asks,
  and by number as netCDF-4 does (`DIM_NUMBER`, `DIM_NUMBERS`), unique in the file.
- Texts are UTF-8 padded with null bytes: in attributes strings of fixed length, in variables arrays of
  characters with a last dimension of their own (`CHARACTERS`) and the attribute `_Encoding`, as in netCDF-3.
- The root's attributes are `format`, `schema_version`, `Conventions` (CF), all that
  `fastmech.store.provenance.provenance` gives, `title` and whatever the run adds, such as `request` (the TOML
  text), `seed`, `wall_time_s`, `method`.
- A variable has one unit, which UDUNITS reads; integers that stand for no value are its `_FillValue`.

All values and attributes are under a checksum: arrays are chunked, shuffled, compressed by gzip and summed by
Fletcher-32; scalars, arrays up to `COMPACT_BYTES` and attributes lie in their object's header, which has a
checksum of its own in the file format of HDF5 1.10. HDF5 keeps whatever has a variable length in a global
heap, which has no checksum and on whose damage HDF5 can loop for ever. So no text is of variable length, and
the reader takes dimensions by their numbers, not by HDF5's lists of references.
"""

from __future__ import annotations

FORMAT = "fastmech results"
"""Value of the root attribute `format`, by which a result file is known."""

SCHEMA_VERSION = 3
"""Value of the root attribute `schema_version`: raised when an older reader would misread a newer file.

1: states as one variable with several units along `component`, curves among the variables of their map, no
coordinates of `equilibrium` and `trajectory`. 2: texts of variables as strings of fixed length.
"""

CONVENTIONS = "CF-1.11"
"""Value of the root attribute `Conventions`."""

CHANGE = "scene_"
"""Prefix of the attributes of a section that hold its changes of the scene."""

LIBRARY_VERSIONS = ("v110", "v110")
"""Bounds of the HDF5 file format: 1.10 has checksums for metadata; later features would shut out readers."""

COMPACT_BYTES = 4096
"""Largest array kept in its object's header."""

DIM_NUMBER = "_Netcdf4Dimid"
"""Attribute of a dimension scale: the dimension's number."""

DIM_NUMBERS = "_Netcdf4Coordinates"
"""Attribute of a variable: the numbers of its dimensions."""

DIMENSION_ONLY = "This is a netCDF dimension but not a netCDF variable."
"""netCDF-4's mark of a dimension without coordinate; the size follows, right-aligned in ten columns."""

CHARACTERS = "string"
"""Name of the last dimension of texts; the number of bytes follows."""

ENCODING = "_Encoding"
"""Attribute of arrays of characters: the encoding of their texts."""
