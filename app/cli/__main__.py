"""Entry point of the `gainline` command. It imports nothing at module level, because every spawned process imports it
again."""


def main() -> None:
    """Run the command line."""
    from app.cli.commands import app  # noqa: PLC0415

    app()


if __name__ == "__main__":
    main()
