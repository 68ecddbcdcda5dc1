#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Builds the wheel and the source archive, as pip asks for them (PEP 517). It needs nothing but Python, so that `pip install`
works without a network.

    build_wheel.py FOLDER    builds both there
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import io
import re
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCES = ("cles/*.py", "cles/py.typed")
DATE = (2026, 1, 1, 0, 0, 0)  # of all files, so that equal sources make equal archives


def project() -> dict:
    return tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def version() -> str:
    """Defined in one place."""
    return re.search(r'^VERSION = "(.+)"$', (HERE / "cles/core.py").read_text(encoding="utf-8"), re.MULTILINE)[1]


def sources() -> dict[str, bytes]:
    return {path.relative_to(HERE).as_posix(): path.read_bytes()
            for pattern in SOURCES for path in sorted(HERE.glob(pattern))}


def licence() -> bytes:
    """In the repository, it lies beside this folder."""
    return next(path for path in (HERE / "LICENSE", HERE.parent / "LICENSE") if path.exists()).read_bytes()


def metadata() -> bytes:
    told = project()
    head = [("Metadata-Version", "2.1"), ("Name", told["name"]), ("Version", version()), ("Summary", told["description"]),
            ("License", told["license"]["text"]), ("Requires-Python", told["requires-python"]),
            *(("Classifier", each) for each in told["classifiers"]), ("Description-Content-Type", "text/markdown")]
    return "".join(f"{key}: {value}\n" for key, value in head).encode() + b"\n" + (HERE / "README.md").read_bytes()


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    info = f"cles-{version()}.dist-info"
    files = {**sources(), f"{info}/LICENSE": licence(), f"{info}/METADATA": metadata(),
             f"{info}/WHEEL": b"Wheel-Version: 1.0\nGenerator: build_wheel.py\nRoot-Is-Purelib: true\nTag: py3-none-any\n"}
    record = ""
    for name, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        record += f"{name},sha256={digest},{len(data)}\n"
    files[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n".encode()
    wheel = f"cles-{version()}-py3-none-any.whl"
    with zipfile.ZipFile(Path(wheel_directory) / wheel, "w") as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, DATE)
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
    return wheel


def build_sdist(sdist_directory, config_settings=None):
    folder = f"cles-{version()}"
    files = {**sources(), "LICENSE": licence(), "PKG-INFO": metadata(),
             **{name: (HERE / name).read_bytes() for name in ("README.md", "build_wheel.py", "pyproject.toml")},
             **{path.relative_to(HERE).as_posix(): path.read_bytes() for path in sorted(HERE.glob("examples/*.py"))}}
    name = f"{folder}.tar.gz"
    with gzip.GzipFile(Path(sdist_directory) / name, "wb", mtime=0) as packed, \
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for file, data in files.items():
            entry = tarfile.TarInfo(f"{folder}/{file}")
            entry.size, entry.mode = len(data), 0o644
            archive.addfile(entry, io.BytesIO(data))
    return name


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    print(folder / build_wheel(folder))
    print(folder / build_sdist(folder))
