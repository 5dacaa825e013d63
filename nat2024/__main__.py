"""`python -m nat2024` is `nat-bench`."""

from nat2024.cli import main

if __name__ == "__main__":
    main()
