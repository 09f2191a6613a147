"""Takes from unpacked npm packages of Noto Sans JP and SC the subsets that the touch screen needs.

    npm pack @fontsource/noto-sans-jp @fontsource/noto-sans-sc      # and unpack each
    python launch_scripts/lib/ui_fonts.py noto-sans-jp/package noto-sans-sc/package

Regular: the characters of everyday writing (JIS X 0208 level 1, GB 2312 level 1), because missions are named by their
site. Bold: those of the catalogue, for headings; other bold characters are drawn by the browser from the regular ones.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path

WEB = Path(__file__).resolve().parents[2] / "robot_stack" / "ui" / "web"
FONTS = WEB / "vendor" / "fonts"
_FACE = re.compile(r"@font-face \{.*?\}", re.DOTALL)
_FILE = re.compile(r"files/([\w.-]+\.woff2)")
_RANGE = re.compile(r"unicode-range: ([^;]+);")
# First byte of the level-1 characters and signs of both character sets, as EUC.
_LEVEL_1 = {"noto-sans-jp": ("euc_jp", 0xA1, 0xCF), "noto-sans-sc": ("gb2312", 0xA1, 0xD7)}


def everyday(encoding: str, first: int, last: int) -> set[int]:
    """Code points of everyday writing, ASCII included."""
    found = set(range(0x20, 0x7F))
    for row in range(first, last + 1):
        for cell in range(0xA1, 0xFF):
            try:
                found.add(ord(bytes((row, cell)).decode(encoding)))
            except (UnicodeDecodeError, TypeError):
                continue
    return found


def catalogue() -> set[int]:
    """Code points of all texts of the pages."""
    texts = json.loads((WEB / "texts.json").read_text(encoding="utf-8"))
    return {ord(letter) for entry in texts.values() for text in entry.values() for letter in text}


def covered(face: str) -> set[int]:
    """Code points of a font face's unicode-range."""
    match = _RANGE.search(face)
    if match is None:
        return set()
    found: set[int] = set()
    for part in match[1].split(","):
        low, _, high = part.strip().removeprefix("U+").partition("-")
        found |= set(range(int(low, 16), int(high or low, 16) + 1))
    return found


def take(package: Path) -> list[str]:
    """Copies what is needed of one package; its faces as CSS."""
    name = json.loads((package / "package.json").read_text(encoding="utf-8"))["name"].rpartition("/")[2]
    wanted = {"400": everyday(*_LEVEL_1[name]) | catalogue(), "700": catalogue()}
    rules = []
    for weight, letters in wanted.items():
        for face in _FACE.findall((package / f"{weight}.css").read_text(encoding="utf-8")):
            file = _FILE.search(face)
            if file is None or not covered(face) & letters:
                continue
            shutil.copy(package / "files" / file[1], FONTS / file[1])
            rules.append(re.sub(r"src: .*?;", f"src: url(/vendor/fonts/{file[1]}) format('woff2');", face))
    shutil.copy(package / "LICENSE", FONTS / f"LICENSE-{name}.txt")
    return rules


def main() -> None:
    FONTS.mkdir(parents=True, exist_ok=True)
    for old in FONTS.glob("*.woff2"):
        old.unlink()
    rules = [rule for package in sys.argv[1:] for rule in take(Path(package))]
    (FONTS / "fonts.css").write_text("\n".join(rules) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
