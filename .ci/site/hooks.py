"""What the site of the documentation has beside docs/: the papers at the top of the checkout, and full docstrings.

mkdocs calls the public functions. The pages are written for a code host and stay as they are.
"""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAPERS = {
    "README.md": "readme.md",
    "CHANGELOG.md": "changes.md",
    "LICENSE": "licence.md",
    "sample_data/README.md": "sample-data.md",
}
"""Files outside docs/, and the names of their pages."""
ASSETS = ("iframe-worker.js", "site.css")
BLOCK = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for each paper, and what the pages load."""
    for path, page in PAPERS.items():
        text = (ROOT / path).read_text(encoding="utf-8")
        if path == "LICENSE":
            text = f"# Licence\n\n```text\n{text.rstrip()}\n```\n"
        files.append(File.generated(config, page, content=text))
    for name in ASSETS:
        files.append(File.generated(config, f"assets/{name}", abs_src_path=str(HERE / name)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Let links lead to pages of the site, tables read as on a code host, and the Python page have all docstrings."""
    sources = {page: path for path, page in PAPERS.items()}
    source = ROOT / sources.get(page.file.src_uri, f"docs/{page.file.src_uri}")
    parts, last = [], 0
    for block in BLOCK.finditer(markdown):  # code stays as it is
        parts += [_prose(markdown[last : block.start()], source.parent), block[0]]
        last = block.end()
    return "".join([*parts, _prose(markdown[last:], source.parent)])


def _prose(text: str, folder: Path) -> str:
    """Write what stands between blocks of code for the site."""
    text = re.sub(r"(?<=\]\()(?!https?:|#)[^)\s#]+", lambda target: _in_site(folder / target[0]), text)
    text = re.sub(r"^\|.*$", _plain_bars, text, flags=re.MULTILINE)
    return re.sub(r"^<!-- begin python -->$.*?^<!-- end python -->$", _docstrings, text, flags=re.DOTALL | re.MULTILINE)


def _in_site(target: Path) -> str:
    """Give the page of the site for a file of the checkout."""
    path = target.resolve().relative_to(ROOT).as_posix()
    return PAPERS.get(path, path.removeprefix("docs/"))


def _plain_bars(row: re.Match[str]) -> str:
    """Take the backslashes off the bars within code in a row: a code host needs them there, mkdocs shows them."""
    return re.sub(r"`[^`]*`", lambda code: code[0].replace(r"\|", "|"), row[0])


def _docstrings(part: re.Match[str]) -> str:
    """Put the whole docstring of each name in the place of its first line."""
    found = re.findall(r"^### (\w+)$", part[0], re.MULTILINE)
    return "\n\n".join(f"### {name}\n\n::: cylx.{name}" for name in found)
