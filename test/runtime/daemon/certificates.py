# SPDX-License-Identifier: BSL-1.0
"""Certificates for a test, valid for a day."""

import shutil
import subprocess

OPENSSL = shutil.which("openssl")


def _request(name, certificate, key, *more):
    subprocess.run([OPENSSL, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1",
                    "-subj", f"/CN={name}", "-out", certificate, "-keyout", key, *more],
                   check=True, stdin=subprocess.DEVNULL, capture_output=True)


class Authority:
    """Its certificate is the file `certificate`."""

    def __init__(self, folder, name):
        self.folder, self.name = folder, name
        self.certificate, self.key = folder.file(f"{name}.pem"), folder.file(f"{name}.key")
        _request(name, self.certificate, self.key)

    def issue(self, name, addresses="IP:127.0.0.1"):
        """The files of a certificate and its key."""
        certificate, key = self.folder.file(f"{self.name}-{name}.pem"), self.folder.file(f"{self.name}-{name}.key")
        _request(name, certificate, key, "-CA", self.certificate, "-CAkey", self.key,
                 "-addext", f"subjectAltName={addresses}", "-addext", "basicConstraints=critical,CA:FALSE")
        return certificate, key
