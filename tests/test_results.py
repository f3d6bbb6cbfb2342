"""What `make accept` has written down: every law held when it last ran at full size."""

import json

from acceptance import RESULTS

LAWS = json.loads(RESULTS.read_text("utf-8"))["laws"]


def test_every_law_held():
    assert [row for row in LAWS if not row["holds"] or not row["seen"] <= row["required"]] == []


def test_the_record_is_of_full_size():
    assert len(LAWS) > 2000
    assert {row["samples"] for row in LAWS} >= {1000, 100_000, 1_000_000}
