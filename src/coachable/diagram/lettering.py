"""Lines of text in SVG, of a size that is estimated, with signals in colour and dots above their letters."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from unicodedata import combining

from coachable.behaviours.notation import DOT_ABOVE

SIZES: Mapping[str, float] = {
    "name": 17.0,
    "title": 12.5,
    "formula": 15.0,
    "event": 14.0,
    "reset": 14.5,
    "note": 12.0,
    "dwell": 12.0,
    "words": 13.5,
    "heading": 16.0,
    "description": 12.5,
}
"""The size of each kind of text [px]."""

_LEADING: Mapping[str, float] = {"title": 1.3, "formula": 1.55, "reset": 1.5, "description": 1.35}
_BOLD = ("name", "event", "heading")
_WIDTHS: Mapping[str, float] = {
    character: width
    for width, characters in {
        0.3: "'IJijl",
        0.35: ",./:;\\f| \u00a0·",
        0.41: "!()-[]t₀₁₂₃₄₅₆₇₈₉⁺²³",
        0.46: '"r',
        0.5: "*_`–",
        0.55: "?Lcsz“”",
        0.6: "FPkvxyγ",
        0.7: "ABCRVXZ",
        0.75: "HNU∧∨",
        0.8: "&DGOQ",
        0.84: "#+<=>^w~ω≤≥−±¬→↔",
        0.9: "M",
        0.95: "%",
        1.0: "@Wm—…",
    }.items()
    for character in characters
}
_LETTER, _OTHER, _BOLDER = 0.64, 1.0, 1.14
"""How wide letters are in DejaVu Sans, about the widest of the fonts that a reader may have."""

_FORBIDDEN = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


@dataclass(frozen=True)
class Line:
    """A line of text: a kind, and cells that start at fixed distances from its left end, in letter sizes."""

    kind: str
    cells: tuple[tuple[float, str], ...]

    @staticmethod
    def plain(kind: str, text: str) -> Line:
        """A line of one cell."""
        return Line(kind, ((0.0, text),))

    @property
    def width(self) -> float:
        """The estimated length of the line, since no fonts are available here [px]."""
        widest = max(start + text_width(text, self.kind in _BOLD) for start, text in self.cells)
        return widest * SIZES[self.kind]

    @property
    def height(self) -> float:
        """The height of the line [px]."""
        return _LEADING.get(self.kind, 1.4) * SIZES[self.kind]


def size_of(lines: Sequence[Line]) -> tuple[float, float]:
    """Width and height of lines below one another [px]."""
    return max((line.width for line in lines), default=0.0), sum((line.height for line in lines), 0.0)


def lettering(lines: Sequence[Line], left: float, top: float, colours: Mapping[str, str]) -> str:
    """SVG of lines below one another; `colours` are those of the words that have one."""
    parts = []
    for line in lines:
        size = SIZES[line.kind]
        top += line.height
        baseline = top - 0.36 * size
        for start, text in line.cells:
            x = left + start * size
            if text[1:2] == DOT_ABOVE:
                # Few fonts put a combining dot clear of a letter as high as θ.
                fill = next((colour for word, colour in colours.items() if text.startswith(word)), "#1f2933")
                place = f'cx="{x + 0.3 * size:.1f}" cy="{baseline - 0.92 * size:.1f}"'
                parts.append(f'<circle {place} r="1.3" fill="{fill}"/>')
            content = _coloured(text, colours)
            parts.append(f'<text class="{line.kind}" x="{x:.1f}" y="{baseline:.1f}">{content}</text>')
    return "".join(parts)


def text_width(text: str, bold: bool = False) -> float:
    """An upper estimate of the length of a text, in letter sizes."""
    # Scripts beyond Greek may be as wide as they are high.
    width = sum(
        _WIDTHS.get(character, _LETTER if character < "\u0530" else _OTHER)
        for character in text
        if not combining(character)
    )
    return (_BOLDER if bold else 1.0) * width


def safe(text: str) -> str:
    """Text that XML shows and does not read, without the characters that XML cannot hold."""
    return escape(_FORBIDDEN.sub("", text))


def _coloured(text: str, colours: Mapping[str, str]) -> str:
    if not colours:
        return safe(text)
    words = re.compile("|".join(sorted(map(re.escape, map(safe, colours)), key=len, reverse=True)))
    by_word = {safe(word): colour for word, colour in colours.items()}

    def paint(match: re.Match[str]) -> str:
        letters = (
            match[0][0] + match[0][2:] if match.start() == 0 and match[0][1:2] == DOT_ABOVE else match[0]
        )
        return f'<tspan fill="{by_word[match[0]]}">{letters}</tspan>'

    return words.sub(paint, safe(text))
