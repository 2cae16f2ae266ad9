"""``python -m scanweld``: the command line."""

from scanweld.app.cli import main

if __name__ == "__main__":
    main()
