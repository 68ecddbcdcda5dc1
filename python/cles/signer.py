# SPDX-License-Identifier: BSL-1.0
"""Signatures with the key of this node, by the library that Python's ssl uses: Python code would leak the key by the time that
it takes."""

from __future__ import annotations

import ctypes
import ctypes.util
from typing import Any

from .errors import RefusedError


def _load() -> Any:
    try:
        return ctypes.CDLL("libcrypto.so.3")
    except OSError:
        name = ctypes.util.find_library("crypto")
        if name is None:
            raise RefusedError("libcrypto, which signs, is not installed") from None
        return ctypes.CDLL(name)


class Signer:
    """Of an Ed25519 key in PEM."""

    def __init__(self, pem: bytes) -> None:
        library = self._library = _load()
        for name, result, arguments in (
                ("BIO_new_mem_buf", ctypes.c_void_p, [ctypes.c_char_p, ctypes.c_int]),
                ("BIO_free", ctypes.c_int, [ctypes.c_void_p]),
                ("PEM_read_bio_PrivateKey", ctypes.c_void_p, [ctypes.c_void_p] * 4),
                ("EVP_MD_CTX_new", ctypes.c_void_p, []),
                ("EVP_MD_CTX_free", None, [ctypes.c_void_p]),
                ("EVP_DigestSignInit", ctypes.c_int, [ctypes.c_void_p] * 5),
                ("EVP_DigestSign", ctypes.c_int, [ctypes.c_void_p, ctypes.c_char_p, ctypes.POINTER(ctypes.c_size_t),
                                                  ctypes.c_char_p, ctypes.c_size_t])):
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        source = library.BIO_new_mem_buf(pem, len(pem))
        self._key = library.PEM_read_bio_PrivateKey(source, None, None, None)
        library.BIO_free(source)
        if not self._key:
            raise RefusedError("the private key cannot be read")

    def sign(self, text: bytes) -> bytes:
        library = self._library
        context = library.EVP_MD_CTX_new()
        try:
            made, size = ctypes.create_string_buffer(64), ctypes.c_size_t(64)
            if library.EVP_DigestSignInit(context, None, None, None, self._key) != 1 or \
                    library.EVP_DigestSign(context, made, ctypes.byref(size), text, len(text)) != 1:
                raise RefusedError("the private key cannot sign")
            return made.raw[:size.value]
        finally:
            library.EVP_MD_CTX_free(context)
