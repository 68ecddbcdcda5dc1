#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""HTTP clients with TLS."""

import http.client
import json
import shutil
import ssl
import subprocess
import unittest

from gateway_support import Gateway, read_all, send
from support import PATIENCE
from trust_support import Trust


@unittest.skipUnless(shutil.which("openssl"), "openssl, which makes the certificate, is not installed")
class TlsClients(Trust):
    def setUp(self):
        super().setUp()
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days",
                        "2", "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-keyout", "own.key", "-out",
                        "own.pem"], cwd=self.scratch, check=True, capture_output=True, timeout=PATIENCE)
        self.token = self.good("gateway", "--new-token", "operator", "--tokens", "tokens").out.strip()
        self.gateway = Gateway("--cert", "own.pem", "--key", "own.key", "--tokens", "tokens", cwd=self.scratch)
        self.addCleanup(lambda: self.assertEqual(self.gateway.stop(), 0))
        self.trusting = ssl.create_default_context(cafile=str(self.path("own.pem")))

    def ask(self, method, path, **headers):
        connection = http.client.HTTPSConnection("localhost", self.gateway.port, context=self.trusting, timeout=PATIENCE)
        connection.sock = self.trusting.wrap_socket(self.gateway.raw(), server_hostname="localhost")
        try:
            send(connection, method, path, None, {"Authorization": f"Bearer {self.token}", **headers})
            response = connection.getresponse()
            return response.status, response.headers, response.read().decode()
        finally:
            connection.close()

    def test_requests_are_encrypted(self):
        self.assertEqual(self.gateway.scheme, "https")
        status, _, body = self.ask("GET", "/session")
        self.assertEqual((status, json.loads(body)["name"]), (200, "operator"))
        status, headers, _ = self.ask("POST", "/session")
        self.assertTrue(headers["Set-Cookie"].endswith("; Secure"))
        self.assertEqual(self.ask("GET", "/session", Origin=f"https://localhost:{self.gateway.port}")[0], 200)
        self.assertEqual(self.ask("GET", "/session", Origin=f"http://localhost:{self.gateway.port}")[0], 403)

    def test_clients_without_tls_are_refused(self):
        with self.gateway.raw() as client:
            client.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            self.assertNotIn("HTTP/1.1 200", read_all(client))
        self.assertEqual(self.ask("GET", "/session")[0], 200)

    def test_old_versions_are_refused(self):
        old = ssl.create_default_context(cafile=str(self.path("own.pem")))
        old.minimum_version = ssl.TLSVersion.MINIMUM_SUPPORTED
        old.maximum_version = ssl.TLSVersion.TLSv1_1
        old.set_ciphers("DEFAULT:@SECLEVEL=0")
        with self.gateway.raw() as client, self.assertRaises((ssl.SSLError, ConnectionError)):
            old.wrap_socket(client, server_hostname="localhost")

    def test_a_certificate_and_a_key_that_do_not_fit(self):
        self.path("broken.key").write_text("no key\n")
        self.failed("gateway", "--http", "127.0.0.1:0", "--cert", "own.pem", "--key", "broken.key", "--tokens", "tokens",
                    says="broken.key")


if __name__ == "__main__":
    unittest.main()
