"""QR codes of addresses: as SVG for a page, as text for a terminal."""

import io
from typing import Final

_WHITE_ON_BLACK: Final = "\x1b[97;40m"
_RESET: Final = "\x1b[0m"


def qr_svg(text: str) -> bytes:
    """SVG of dark modules on white with the quiet zone that readers need, so that it also works on a dark page."""
    import segno

    drawn = io.BytesIO()
    segno.make_qr(text).save(drawn, kind="svg", border=4, dark="#000", light="#fff", omitsize=True, title=text)
    return drawn.getvalue()


def qr_text(text: str) -> str:
    """The code in half blocks, white on black whatever the terminal's colours."""
    import segno

    drawn = io.StringIO()
    segno.make_qr(text).terminal(drawn, border=2, compact=True)
    return "\n".join(f"{_WHITE_ON_BLACK}{line}{_RESET}" for line in drawn.getvalue().splitlines())
