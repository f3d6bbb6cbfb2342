"""Make the tables of all controllers in docs/control.md anew (`make assets`). Takes half a minute."""

import sys
from pathlib import Path

from dhkit.bench.controllers import with_tables
from dhkit.description import write_atomically

PAGE = Path(__file__).resolve().parents[1] / "docs" / "control.md"


def main():
    """Simulate, and write the tables."""
    text = with_tables(PAGE.read_text("utf-8"), lambda line: print(line, file=sys.stderr, flush=True))
    write_atomically(PAGE, text)
    print(f"wrote {PAGE}", file=sys.stderr)


if __name__ == "__main__":
    main()
