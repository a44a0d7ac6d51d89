"""Sections as xarray datasets whose values are read, and their checksums checked, when they are used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from xarray import Dataset
from xarray.backends import BackendArray
from xarray.core import indexing

from fastmech.results import cf_attrs

if TYPE_CHECKING:
    from fastmech.store.read import Section


class StoredArray(BackendArray):
    """The values of a stored variable as xarray asks for them.

    Args:
        section: the section, whose file must be open when values are asked for.
        name: of the variable.
    """

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
        """Values at integers and slices; what runs backwards is read forwards and turned."""
        part: dict[str, slice] = {}
        then: list[int | slice] = []
        for dim, size, place in zip(self._dims, self.shape, key, strict=True):
            chosen = range(*place.indices(size)) if isinstance(place, slice) else range(size)[place]
            if isinstance(chosen, int):
                part[dim] = slice(chosen, chosen + 1)
                then.append(0)
            else:
                forwards = chosen if chosen.step > 0 else chosen[::-1]
                part[dim] = slice(forwards.start, max(forwards.start, forwards.stop), forwards.step)
                then.append(slice(None, None, 1 if chosen.step > 0 else -1))
        (variable,) = self._section.load([self._name], part).variables.values()
        return variable.data[tuple(then)]


def lazy_dataset(section: Section) -> Dataset:
    """A section as a dataset; of its values only the coordinates of its dimensions are read now.

    Raises:
        InputError: those are damaged.
    """
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for name in section:
        about = section.about(name)
        attrs = cf_attrs(about.units, about.long_name, about.attrs, about.dtype)
        if name in section.sizes:
            coordinates[name] = (tuple(about.sizes), section[name].data, attrs)
        else:
            stored = indexing.LazilyIndexedArray(StoredArray(section, name))
            # As xarray's own readers do: read once, and not changed behind the back of a copy.
            cached: Any = indexing.MemoryCachedArray(stored)  # type: ignore[no-untyped-call]
            variables[name] = (tuple(about.sizes), indexing.CopyOnWriteArray(cached), attrs)
    return Dataset(variables, coordinates, dict(section.attrs))
