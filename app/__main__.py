"""Where the `gainline` command begins. It imports nothing: every process that is spawned later imports it again."""


def main() -> None:
    """Run the command line."""
    from app.cli import app  # noqa: PLC0415

    app()


if __name__ == "__main__":
    main()
