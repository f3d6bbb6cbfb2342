"""``python -m dhkit`` is the ``dhkit`` command."""

from dhkit.cli import main

if __name__ == "__main__":
    main()
