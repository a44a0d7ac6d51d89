"""Writing a result file: whole under its final name, or not at all."""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import secrets
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py

from fastmech.errors import InputError
from fastmech.results import Dataset, Variable, check_name, checked_attrs
from fastmech.store.encode import put_attrs, put_dataset
from fastmech.store.schema import (
    CONVENTIONS,
    FORMAT,
    LIBRARY_VERSIONS,
    OWN_ATTRS,
    REQUIRED_ATTRS,
    SCHEMA_VERSION,
)


def check_writable(path: str | Path, replace: bool = False) -> None:
    """Find out before a long run whether its result can be written; missing parent folders are made.

    Args:
        path: the result file to be.
        replace: whether a file of that name may be replaced.

    Raises:
        InputError: the folder is unwritable, the path is a folder, or the file exists and `replace` is False.
    """
    with _readable_reasons(path):
        target = _target(path, replace)
        probe = _aside(target)
        probe.touch(exist_ok=False)
        probe.unlink()


def write_results(
    path: str | Path,
    *,
    scene_parameters: Mapping[str, Variable],
    sections: Mapping[str, Dataset],
    attrs: Mapping[str, Any],
    replace: bool = False,
    aside: Path | None = None,
) -> None:
    """Write a result file (see `fastmech.store.schema`); missing parent folders are made.

    The file is composed in memory, written aside, flushed to the disk and then takes its final name at once:
    under that name there is always a complete file, or the older one, or none.

    Args:
        path: the result file to be.
        scene_parameters: the scene's parameters, scalars with their units.
        sections: one dataset for each section of the request.
        attrs: attributes of the whole: at least those of `schema.REQUIRED_ATTRS`, most of which
            `fastmech.store.provenance.provenance` gives.
        replace: whether a file of that name may be replaced.
        aside: folder on the same file system in which it is written first, by default that of the file.

    Raises:
        InputError: the folder is unwritable, the disk is full, the path is a folder, the file exists and
            `replace` is False, or the content does not fit the schema.
    """
    image = _image(_checked_root(scene_parameters, sections), sections, _checked_root_attrs(attrs))
    with _readable_reasons(path):
        target = _target(path, replace)
        temporary = _aside(aside / target.name if aside is not None else target)
        try:
            with temporary.open("xb") as file:
                file.write(image)
                file.flush()
                os.fsync(file.fileno())
            _publish(temporary, target, replace)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)


def _image(root: Dataset, sections: Mapping[str, Dataset], attrs: Mapping[str, Any]) -> memoryview:
    """The file's bytes.

    Built in memory, because HDF5 may crash the process when the disk is full; a plain write tells it.
    """
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=LIBRARY_VERSIONS, track_order=True) as file:
        put_attrs(file, attrs)
        numbers = itertools.count()
        put_dataset(file, root, numbers)
        for name, dataset in sections.items():
            put_dataset(file.create_group(name, track_order=True), dataset, numbers)
    return buffer.getbuffer()


def _checked_root(scene_parameters: Mapping[str, Variable], sections: Mapping[str, Dataset]) -> Dataset:
    for name, parameter in scene_parameters.items():
        if parameter.dims or parameter.data.dtype != "float64":
            raise InputError(f"scene_parameters.{name}: must be a scalar of float64")
    for name in sections:
        check_name(name, "sections")
        if name in scene_parameters:
            raise InputError(f"sections.{name}: is the name of a parameter of the scene; choose another")
    return Dataset(scene_parameters)


def _checked_root_attrs(attrs: Mapping[str, Any]) -> dict[str, Any]:
    missing = [name for name in REQUIRED_ATTRS if name not in attrs]
    if missing:
        raise InputError(f"attrs: lack {', '.join(missing)}; every result file has them")
    for name in OWN_ATTRS:
        if name in attrs:
            raise InputError(f"attrs.{name}: is written by the store itself")
    own = dict(zip(OWN_ATTRS, (FORMAT, SCHEMA_VERSION, CONVENTIONS), strict=True))
    return {**own, **checked_attrs(attrs, "attrs")}


def _target(path: str | Path, replace: bool) -> Path:
    """The file that `path` names, symbolic links followed, in a folder that exists."""
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise InputError(f"{path}: is a folder; give the name of a file in it")
    if target.exists() and not replace:
        raise _already_exists(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    return target


def _aside(target: Path) -> Path:
    return target.with_name(f".fastmech-{secrets.token_hex(8)}.tmp")


def _publish(temporary: Path, target: Path, replace: bool) -> None:
    if replace:
        os.replace(temporary, target)
    else:
        try:
            # a link is made only if the name is free, whoever else tries at the same time
            os.link(temporary, target)
        except FileExistsError:
            raise _already_exists(target) from None
        except OSError:
            # a file system without hard links: not exclusive against a race, but still all or nothing
            if target.exists():
                raise _already_exists(target) from None
            os.replace(temporary, target)
    _flush_folder(target.parent)


def _flush_folder(folder: Path) -> None:
    # some systems cannot do it; the file itself is safe by now
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _already_exists(path: str | Path) -> InputError:
    return InputError(f"{path}: exists already; remove it, choose another name or allow replacing it")


@contextlib.contextmanager
def _readable_reasons(path: str | Path) -> Iterator[None]:
    """Turn the failures of a file system into one line with the path and the system's reason."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error
