#!/usr/bin/python3
"""The comparison of pages catches what is wrong and lets pass what may differ: pages of echo, without the programs."""
import tempfile
import unittest
from pathlib import Path

import test_pages

FENCE = "```"


class Comparison(unittest.TestCase):
    def check(self, page, renew=False):
        """Faults of a page, and the page after the run."""
        with tempfile.NamedTemporaryFile("w", suffix=".md", delete=False) as file:
            file.write("<!-- folder: build/page -->\n\n" + page)
        path = Path(file.name)
        self.addCleanup(path.unlink)
        faults = test_pages.Page(path, Path("/nowhere"), renew).run()
        return faults, path.read_text().partition("\n\n")[2]

    def output(self, printed, shown, **options):
        return self.check(f"<!-- run: printf '%s\\n' {printed} -->\n\n{FENCE}\n{shown}\n{FENCE}\n", **options)

    def test_what_is_printed_passes(self):
        for printed, shown in (("'a 1 b'", "a 1 b"), ("'x' 'a 1' 'y' 'b 2'", "...\na 1\n...\nb 2"), ("'a   12.30 %'", "a 12.34 %"),
                               ("'1.234e-14'", "3.77e-15"), ("'took 5 us'", "took 7 us"), ("'steps: 7 of 9, 2 s, about 1 s left' 'a 1'", "a 1"), ("'real-time factor  3'", "real-time factor  9"),
                               ("'[10:00:00] [info] a'", "[20:48:01] [info] a"), ("'0123456789abcdef'", "fedcba9876543210"),
                               ("'n  seconds' '1     2.00'", "n  seconds\n1     4.00")):
            self.assertEqual(self.output(printed, shown)[0], [], (printed, shown))

    def test_what_is_not_printed_is_a_fault(self):
        for printed, shown in (("'a 2 b'", "a 1 b"), ("'a 1 c'", "a 1 b"), ("'a 1'", "a 1\nb 2"), ("'x' 'a 1'", "a 1"), ("'b' 'a'", "a\n...\nb"),
                               ("'a 12.30 %'", "a 12.45 %"), ("'341 vertices'", "340 vertices"), ("'simulated time 3 s'", "simulated time 2 s"),
                               ("'n  seconds' '2     2.00'", "n  seconds\n1     2.00"),
                               ("'0123456789abcdef' '0123456789abcdee'", "fedcba9876543210\nfedcba9876543210")):
            self.assertNotEqual(self.output(printed, shown)[0], [], (printed, shown))

    def test_status_and_files(self):
        self.assertEqual(self.check(f"<!-- file: a.txt -->\n{FENCE}json\n{{}}\n{FENCE}\n\n    cat a.txt\n\n{FENCE}\n{{}}\n{FENCE}\n")[0], [])
        self.assertNotEqual(self.check("    false\n")[0], [])
        self.assertNotEqual(self.check("<!-- run: true --> and words\n")[0], [])
        self.assertEqual(self.check("<!-- status: 1 -->\n\n    false\n\n<!-- skip -->\n\n    exit 3\n")[0], [])

    def test_what_needs_a_package_is_left_out_without(self):
        page = f"<!-- needs: {{}} -->\n<!-- run: echo a 1 -->\n\n{FENCE}\na 2\n{FENCE}\n\n    echo b 1\n\n{FENCE}\nb {{}}\n{FENCE}\n"
        self.assertEqual(self.check(page.format("no-such-package", 1))[0], [])
        self.assertEqual(len(self.check(page.format("no-such-package", 2))[0]), 1)
        self.assertEqual(len(self.check(page.format("eigen3", 1))[0]), 1)

    def test_quotes(self):
        page = "<!-- quote: examples/engine/cookbook.cpp {} -->\n" + f"{FENCE}cpp\nint x;\n{FENCE}\n"
        self.assertEqual(len(self.check(page.format("model"))[0]), 1)
        self.assertEqual(len(self.check(page.format("no such"))[0]), 1)
        faults, renewed = self.check(page.format("model"), renew=True)
        self.assertEqual((faults, self.check(renewed)[0]), ([], []))

    def test_rows_and_renewal(self):
        table = "<!-- rows: echo $(($1 * 3)) -->\n\n| n | threefold |\n| --- | --- |\n| 2 | 6 |\n| 1,000 | {} J |\n"
        self.assertEqual(self.check(table.format("3,000"))[0], [])
        self.assertEqual(len(self.check(table.format("4,000"))[0]), 1)
        self.assertEqual(self.check(table.format("4,000"), renew=True), ([], table.format("3,000")))
        faults, page = self.output("'a 2 b'", "a 1 b", renew=True)
        self.assertEqual((faults, "a 2 b" in page), ([], True))


if __name__ == "__main__":
    unittest.main(verbosity=2)
