"""The report: a page that is whole, holds every figure and loads nothing from outside."""

import base64
import io
import json
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fcsim.bench.reporting import report
from fcsim.bench.reporting.page import markdown_text
from fcsim.bench.results import Measurement, append
from fcsim.command_line.main import main
from fcsim.errors import InputError
from fcsim.view.page.write import library

VOID = {"meta", "img", "br", "hr", "link", "input"}
LOADING = {
    "img": "src",
    "script": "src",
    "link": "href",
    "iframe": "src",
    "source": "src",
    "object": "data",
    "embed": "src",
    "image": "href",
}


class Page(HTMLParser):
    """Reads a page: checks that elements close in order, and collects pictures, addresses that load something, and the text."""

    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.loaded, self.words, self.ids, self.links, self.cells = [], [], [], [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if tag not in VOID:
            self.open.append(tag)
        if tag in LOADING and LOADING[tag] in given:
            self.loaded.append(given[LOADING[tag]])
        if tag == "img":
            self.images.append(given)
        if "id" in given:
            self.ids.append(given["id"])
        if tag == "a":
            self.links.append(given["href"])

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, tag

    def handle_data(self, data):
        self.words.append(data)
        if self.open and self.open[-1] in ("td", "th"):
            self.cells.append(data)

    @property
    def text(self):
        return " ".join(self.words)


def picture(path):
    Image.fromarray(np.random.default_rng(1).integers(0, 255, (20, 30, 3), dtype=np.uint8)).save(path)


def decoded(image):
    kind, _, content = image["src"].partition(";base64,")
    return kind, base64.b64decode(content, validate=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("results")
    rng = np.random.default_rng(2)
    for p in range(6):
        for tol in (1e-2, 1e-6):
            for k, solver in enumerate(("NSN-AC", "NSGS-AC", "<b>&odd")):
                seconds = float((k + 1) * rng.lognormal())
                late = "TIME_LIMIT: not tried: 0.01 not met in time" if tol == 1e-6 else "KILLED_TIME"
                ended = late if p == 5 or (solver == "NSGS-AC" and tol == 1e-6 and p > 2) else "SOLVED"
                row = Measurement(
                    f"Wall-i{p}-10-{p}", "global", 3, 10 + p, 60, "fcsim", solver, tol, 7.5, 2048.0, ended, ended == "SOLVED",
                    seconds if ended == "SOLVED" else None, seconds, 3, tol / 2, None, "Processor X, 2 cores", 1, "0.1.0",
                    f"2024-01-0{p + 1}T00:00:00+00:00",
                )  # fmt: skip
                append(path, row)
    (path / "profiles").mkdir()
    picture(path / "profiles" / "convergence-Wall-i3.png")
    return path


@pytest.fixture(scope="module")
def collection(tmp_path_factory):
    path = tmp_path_factory.mktemp("sets") / "MySet"
    path.mkdir()
    picture(path / "picture.png")
    picture(path / "extra.png")
    (path / "README.md").write_text(
        "# My set\n\n![the wall](picture.png)\n\n| | |\n|:---|:---|\n| contacts | [10:15] |\n\n<script>alert(1)</script>\n\n"
        "![remote](https://example.org/x.png) ![outside](../../secret.png) See <https://example.org/about>.\n"
    )
    (path / "manifest.csv").write_text("name,form,nc,condition,sha256\nW-1.hdf5,global,10,1.23456e8,abc\nW-2.hdf5,global,11,2e8,abd\n")
    return path


@pytest.fixture(scope="module")
def page(folder, collection):
    assert main(["report", str(folder), "--collection", str(collection), "--reference", "NSGS-AC"]) == 0
    assert not list(folder.glob(".*"))  # no temporary file stays
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def test_nothing_is_loaded_from_outside(page, folder):
    assert page.loaded and all(address.startswith("data:image/") for address in page.loaded)
    text = (folder / "report.html").read_text(encoding="utf-8")
    own = text.replace(library(), "")  # plotly's own script names addresses that it does not ask for: the browser test sees none asked
    assert len(own) < len(text) and "url(" not in own and "@import" not in own and "default-src 'none'" in own
    assert not re.search(r"<(script|link|iframe)[^>]*(src|href)=", own)
    assert [link for link in page.links if link.startswith("http")] == ["https://example.org/about"]  # a link loads nothing by itself
    assert "[remote]" in page.text and "[outside]" in page.text and "<script>alert(1)</script>" in page.text


def test_every_figure_is_there_and_described(page):
    alts = [image["alt"] for image in page.images]
    assert all(len(alt) > 5 for alt in alts)
    for expected in ("at tolerance 1e-2", "at tolerance 1e-6", "as panels", "on Wall-i3", "the wall", "extra of the collection MySet"):
        assert sum(expected in alt for alt in alts) == 1, expected
    assert len(alts) == 6
    kinds = []
    for image in page.images:
        kind, content = decoded(image)
        kinds.append(kind)
        if kind == "data:image/svg+xml":
            assert ElementTree.fromstring(content).tag == "{http://www.w3.org/2000/svg}svg"
        else:
            assert Image.open(io.BytesIO(content)).size[0] > 10
    assert sorted(kinds) == 3 * ["data:image/png"] + 3 * ["data:image/svg+xml"]
    first = next(alt for alt in alts if "at tolerance 1e-6" in alt)
    assert "NSGS-AC won" in first and "NSGS-AC won 0%, solved 50%" in first  # 3 of 6


def test_what_is_said(page):
    for said in (
        "Processor X, 2 cores", "fcsim 0.1.0", "time limit of 7.5 s", "memory limit of 2048 MiB", "censored", "<b>&odd",
        "fcsim bench MySet --solvers 'NSN-AC,NSGS-AC,<b>&odd' --tols 1e-2,1e-6 --time-limit 7.5 --memory-limit 2048",
        "from 2024-01-01T00:00:00+00:00 to 2024-01-06T00:00:00+00:00", "6 problems, 3 solvers, 36 measurements", "My set",
    ):  # fmt: skip
        assert said in page.text, said
    # of 36 measurements: the sixth problem 3 x 2, NSGS-AC at 1e-6 on two more
    assert "8 of 36 measurements ended at the time limit" in page.text
    assert "(5 of them without a try" in page.text
    assert "W-1.hdf5" in page.cells and "1.235e+08" in page.cells and "sha256" not in page.cells


def test_the_call_that_the_bench_noted_is_shown(folder, tmp_path, capsys):
    copy = tmp_path / "results"
    copy.mkdir()
    (copy / "results.csv").write_bytes((folder / "results.csv").read_bytes())
    (copy / "bench.json").write_text(json.dumps({"command": "fcsim bench sets/MySet --jobs 2 --out results"}))
    assert main(["report", str(copy), "--clock", "cpu", "--solvers", "NSN-AC,NSGS-AC"]) == 0
    text = Page((copy / "report.html").read_text(encoding="utf-8")).text
    assert "fcsim bench sets/MySet --jobs 2 --out results\nfcsim profile results --solvers NSN-AC,NSGS-AC --clock cpu\n" in text
    assert "processor time of the whole solve" in text
    (copy / "bench.json").write_text("{")
    assert main(["report", str(copy)]) == 2
    assert "bench.json: expected the note" in capsys.readouterr().err


def test_links_within_the_page_lead_somewhere(page):
    inside = [link[1:] for link in page.links if link.startswith("#")]
    assert len(inside) >= 6 and set(inside) <= set(page.ids) and len(page.ids) == len(set(page.ids))


def test_the_table_itself_is_in_the_page(page, folder):
    (uri,) = [link for link in page.links if link.startswith("data:text/csv")]
    assert base64.b64decode(uri.partition("base64,")[2]) == (folder / "results.csv").read_bytes()


def test_title_place_and_selection(folder, tmp_path):
    out = tmp_path / "new" / "page.html"
    assert main(["report", str(folder), "--title", "A <new> title", "--out", str(out), "--tols", "1e-2", "--solvers", "NSN-AC"]) == 0
    read = Page(out.read_text(encoding="utf-8"))
    assert "A <new> title" in read.text and "NSGS-AC" not in read.text and len(read.images) == 2


def test_a_failure_leaves_the_earlier_page(folder, tmp_path, capsys):
    out = tmp_path / "page.html"
    out.write_text("earlier")
    assert main(["report", str(folder), "--out", str(out), "--collection", str(tmp_path / "none")]) == 2
    assert "--collection" in capsys.readouterr().err and out.read_text() == "earlier"
    (tmp_path / "empty").mkdir()
    assert main(["report", str(folder), "--out", str(out), "--collection", str(tmp_path / "empty")]) == 2
    assert "empty: expected problems" in capsys.readouterr().err and out.read_text() == "earlier"
    assert main(["report", str(tmp_path)]) == 2
    assert "there is none" in capsys.readouterr().err


def test_pictures_of_markdown_stay_in_their_folder(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    picture(tmp_path / "secret.png")
    picture(inner / "own one.png")
    html, embedded = markdown_text("# T\n\n![a](own%20one.png) ![b](../secret.png) ![c](missing.png) ![d](javascript:x)", inner)
    assert embedded == {"own one.png"} and html.count("<img") == 1 and "<h3>T</h3>" in html
    assert Page(f"<body>{html}</body>").text.count("[") >= 2 and Path(inner / "own one.png").is_file()


def test_pictures_of_a_collection_stay_in_their_folder(tmp_path):
    """Links out of it, folders with the names of pictures and a README of another encoding."""
    secret, folder = tmp_path / "secret.png", tmp_path / "set"
    secret.write_bytes(b"\x89PNG secret")
    folder.mkdir()
    (folder / "mine.png").write_bytes(b"\x89PNG mine")
    (folder / "link.png").symlink_to(secret)
    (folder / "folder.png").mkdir()
    (folder / "README.md").write_bytes("Ein Größenvergleich".encode("latin-1"))
    html = "".join(report._collection(folder)) + "".join(report._convergence(folder))
    assert html.count("<img") == 1 and base64.b64encode(secret.read_bytes()).decode() not in html
    (folder / "convergence-a.png").symlink_to(secret)
    assert report._convergence(folder) == []
    (folder / "manifest.csv").write_bytes(b"name\n\xff\n")
    with pytest.raises(InputError, match=r"manifest\.csv: expected a table as UTF-8 text"):
        report._collection(folder)
