from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fastmech.errors import InputError
from fastmech.results import Dataset
from fastmech.store import write as module
from fastmech.store.read import open_results
from fastmech.store.write import check_writable, write_results

Write = Callable[[], Path]


class Interrupted(BaseException):
    """Stands for any failure, Ctrl-C included."""


def fail(*arguments: Any) -> None:
    raise Interrupted


@pytest.mark.parametrize("step", ["put_dataset", "_publish"])
@pytest.mark.parametrize("older", [False, True])
def test_failure_leaves_nothing_new(
    step: str, older: bool, tmp_path: Path, content: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result.h5"
    if older:
        path.write_bytes(b"older")
    monkeypatch.setattr(module, step, fail)
    with pytest.raises(Interrupted):
        write_results(path, **content, replace=True)
    assert [file.name for file in tmp_path.iterdir()] == (["result.h5"] if older else [])
    assert not older or path.read_bytes() == b"older"


def test_failure_midway_leaves_nothing_new(
    tmp_path: Path, content: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    original, calls = module.put_dataset, []

    def fail_at_the_last(*arguments: Any) -> None:
        calls.append(arguments)
        if len(calls) == 3:
            raise Interrupted
        original(*arguments)

    monkeypatch.setattr(module, "put_dataset", fail_at_the_last)
    with pytest.raises(Interrupted):
        write_results(tmp_path / "result.h5", **content)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("older", [False, True])
def test_failing_flush_is_told_and_leaves_nothing_new(
    older: bool, tmp_path: Path, content: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result.h5"
    if older:
        path.write_bytes(b"older")

    def refuse(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(InputError, match=r"result\.h5: cannot be written: No space left on device"):
        write_results(path, **content, replace=True)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == ([b"older"] if older else [])


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on file sizes")
def test_full_disk_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    # a limit on file sizes makes the system refuse the write, as a full disk does
    code = """
import resource, signal, sys
import numpy as np
from fastmech.errors import InputError
from fastmech.results import Dataset, Variable
from fastmech.store.provenance import provenance
from fastmech.store.write import write_results
noise = Dataset({"noise": Variable(("n",), np.random.default_rng(1).normal(size=300_000))})
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
try:
    attrs = {**provenance(1), "title": "t"}
    write_results(sys.argv[1], scene_parameters={}, sections={"s": noise}, attrs=attrs)
except InputError as error:
    print(error)
"""
    path = tmp_path / "result.h5"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout == f"{path}: cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_existing_file_is_kept(write: Write, content: dict[str, Any]) -> None:
    path = write()
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        write_results(path, **content)
    with pytest.raises(InputError, match="exists already"):
        check_writable(path)
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_file_that_appears_meanwhile_is_kept(
    tmp_path: Path, content: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result.h5"
    original = module._publish

    def publish_late(*arguments: Any) -> None:
        path.write_bytes(b"another's")
        original(*arguments)

    monkeypatch.setattr(module, "_publish", publish_late)
    with pytest.raises(InputError, match="exists already"):
        write_results(path, **content)
    assert path.read_bytes() == b"another's"
    assert list(tmp_path.iterdir()) == [path]


def test_file_system_without_hard_links(
    tmp_path: Path, content: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: Any) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    write_results(tmp_path / "result.h5", **content)
    assert [file.name for file in tmp_path.iterdir()] == ["result.h5"]


def test_replace(write: Write, content: dict[str, Any]) -> None:
    path = write()
    check_writable(path, replace=True)
    content["attrs"]["title"] = "newer"
    write_results(path, **content, replace=True)
    with open_results(path) as results:
        assert results.attrs["title"] == "newer"


def test_parents_are_made(tmp_path: Path, content: dict[str, Any]) -> None:
    path = tmp_path / "a" / "b" / "result.h5"
    check_writable(path)
    assert list(path.parent.iterdir()) == []
    write_results(path, **content)
    assert list(path.parent.iterdir()) == [path]


def test_symbolic_link_is_followed(tmp_path: Path, content: dict[str, Any]) -> None:
    (tmp_path / "link.h5").symlink_to(tmp_path / "elsewhere" / "result.h5")
    write_results(tmp_path / "link.h5", **content)
    assert (tmp_path / "link.h5").is_symlink()
    assert (tmp_path / "elsewhere" / "result.h5").is_file()


def test_unwritable_folder_is_told(tmp_path: Path, content: dict[str, Any]) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "folder" / "result.h5"
    for attempt in (lambda: check_writable(path), lambda: write_results(path, **content)):
        with pytest.raises(InputError) as caught:
            attempt()
        assert str(caught.value) == f"{path}: cannot be written: Not a directory"


def test_refusal_by_the_system_is_told(content: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / ("x" * 300)
    with pytest.raises(InputError, match="cannot be written: File name too long"):
        write_results(path, **content)
    assert list(tmp_path.iterdir()) == []


def test_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"):
        check_writable(tmp_path, replace=True)


def test_content_that_does_not_fit(tmp_path: Path, content: dict[str, Any]) -> None:
    path = tmp_path / "result.h5"
    empty = Dataset({})
    cases: list[tuple[dict[str, Any], str]] = [
        ({"attrs": {**content["attrs"], "bad": None}}, r"attrs\.bad"),
        ({"sections": {"m1": empty}}, "parameter of the scene"),
        ({"sections": {"a/b": empty}}, "'a/b'"),
    ]
    for change, message in cases:
        with pytest.raises(InputError, match=message):
            write_results(path, **{**content, **change})
    assert list(tmp_path.iterdir()) == []
