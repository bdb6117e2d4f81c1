"""Valid names of signals and constants, and valid words of phrases."""

from __future__ import annotations

import re
import unicodedata

RESERVED = ("and", "or", "not", "within", "deadband", "means", "true", "false")
"""The words that join predicates; none of them can be a signal, a constant or a part of a phrase."""

NAME = re.compile(r"[^\W\d]\w*")
WORD = re.compile(r"[^\W\d]\w*(?:['’-]\w+)*")


def flaw_of_name(name: str) -> str | None:
    """Why `name` cannot be the name of a signal or a constant, or `None`."""
    if not (NAME.fullmatch(name) and name.isidentifier()):
        return "a name is made of letters, digits and underscores, no digit first"
    return flaw_of_word(name)


def flaw_of_word(word: str) -> str | None:
    """Why `word` cannot be a word of a phrase, or `None`."""
    if word in RESERVED:
        return f"{word!r} is a word of the language; choose another"
    if not WORD.fullmatch(word):
        return "a word is made of letters, digits, underscores and hyphens, a letter first"
    return flaw_of_letters(word)


def flaw_of_unit(unit: str) -> str | None:
    """Why `unit` cannot be written in brackets, or `None`; the empty unit is valid."""
    if unit == " ".join(unit.split()) and unit.isprintable() and not set('[]"#') & set(unit):
        return None
    return f"a unit such as rad/s has no brackets, quotes, # or needless spaces in it, {unit!r} has"


def flaw_of_letters(word: str) -> str | None:
    """Why the letters of a word are ambiguous, or `None`: a word must use one alphabet.

    Letters that look alike would give two names one appearance. Latin and Greek may be combined (`dθ`), as
    long as the Greek letter does not look like a Latin one.
    """
    if word.isascii():
        return None
    if not unicodedata.is_normalized("NFKC", word):
        return f"{spelt_out(word)} has a plainer spelling; write {unicodedata.normalize('NFKC', word)!r}"
    scripts = {unicodedata.name(letter, "?").partition(" ")[0] for letter in word if letter.isalpha()}
    if scripts <= {"LATIN", "GREEK", "MICRO"}:
        scripts -= {"GREEK", "MICRO"} if not _TAKEN_FOR_LATIN & set(word) else set()
    return f"{spelt_out(word)} mixes letters of several alphabets" if len(scripts) > 1 else None


def spelt_out(word: str) -> str:
    """The word, and the code point and name of each letter in it that is not ASCII."""
    letters = [code_point(letter) for letter in dict.fromkeys(word) if not letter.isascii()]
    return (
        f"{word!r} ({', '.join(letters[:3])}{', …' if len(letters) > 3 else ''})" if letters else repr(word)
    )


def code_point(letter: str) -> str:
    """The code point and name of a character: U+0435 CYRILLIC SMALL LETTER IE."""
    return f"U+{ord(letter):04X} {unicodedata.name(letter, 'without a name')}"


_TAKEN_FOR_LATIN = frozenset("ΑΒΕΖΗΙΚΜΝΟΡΤΥΧικνορυχ")
