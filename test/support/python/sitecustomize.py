# SPDX-License-Identifier: BSL-1.0
"""Has Python tests print why they leave something out: unittest alone prints how often.
`cles_add_python_test` puts this folder into PYTHONPATH, `.ci/skipped_tests.py` reads the lines."""

import sys

if any(word.endswith("_test.py") for word in sys.orig_argv):
    import unittest

    _add_skip = unittest.TextTestResult.addSkip

    def _say_why(self, test, reason):
        _add_skip(self, test, reason)
        self.stream.writeln(f"\nleft out: {test.id()}: {' '.join(str(reason).split())}")

    unittest.TextTestResult.addSkip = _say_why
