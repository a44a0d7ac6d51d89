"""Sections as xarray datasets whose values are read, and their checksums checked, when they are used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from xarray import Dataset
from xarray.backends import BackendArray
from xarray.core import indexing

from fastmech.results import cf_attrs, only_labels

if TYPE_CHECKING:
    from fastmech.store.read import Section


class StoredArray(BackendArray):
    """The values of a section's variable as xarray asks for them, while the file is open."""

    def __init__(self, section: Section, name: str) -> None:
        about = section.about(name)
        self.shape, self.dtype = tuple(about.sizes.values()), about.dtype
        self._section, self._name, self._dims = section, name, tuple(about.sizes)

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        """Values at integers, slices or arrays of places."""
        return indexing.explicit_indexing_adapter(
            key, self.shape, indexing.IndexingSupport.BASIC, self._values
        )

    def _values(self, key: tuple[Any, ...]) -> Any:
        """Values at integers and rising slices."""
        chosen = [range(size)[place] for size, place in zip(self.shape, key, strict=True)]
        parts = [slice(k, k + 1) if isinstance(k, int) else slice(k.start, k.stop, k.step) for k in chosen]
        (variable,) = self._section.load(
            [self._name], dict(zip(self._dims, parts, strict=True))
        ).variables.values()
        return variable.data[tuple(0 if isinstance(k, int) else slice(None) for k in chosen)]


def lazy_dataset(section: Section) -> Dataset:
    """A section as a dataset; of its values only the coordinates of its dimensions are read now.

    Raises:
        InputError: those are damaged.
    """
    arrays: dict[str, Any] = {}
    for part in (section, *(section.groups.values() if only_labels(section) else ())):
        for name in part:
            about = part.about(name)
            if name in part.sizes:
                data: Any = part[name].data
            else:
                # As xarray's own readers do: read once, and not changed behind the back of a copy.
                stored = indexing.LazilyIndexedArray(StoredArray(part, name))
                cached: Any = indexing.MemoryCachedArray(stored)  # type: ignore[no-untyped-call]
                data = indexing.CopyOnWriteArray(cached)
            attrs = cf_attrs(about.units, about.long_name, about.attrs, about.dtype)
            arrays[name] = (tuple(about.sizes), data, attrs)
    return Dataset(arrays, attrs=dict(section.attrs))
