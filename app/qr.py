"""QR codes of addresses: for a page as SVG, for a terminal as text."""

import io

import segno


def qr_svg(text: str) -> bytes:
    """An SVG of dark modules on white with the quiet zone that readers want, also on a dark page."""
    drawn = io.BytesIO()
    segno.make_qr(text).save(drawn, kind="svg", border=4, dark="#000", light="#fff", omitsize=True, title=text)
    return drawn.getvalue()


def qr_text(text: str) -> str:
    """The code in half blocks, for a terminal with light or dark ground alike."""
    drawn = io.StringIO()
    segno.make_qr(text).terminal(drawn, border=2, compact=True)
    return drawn.getvalue().rstrip("\n")
