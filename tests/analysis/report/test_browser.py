"""The page in a real Chromium, from disk: quiet, without a network, everything moving together."""

import contextlib
import html
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from coachable.analysis.report.page import write_report

playwright = pytest.importorskip("playwright.sync_api", reason="the browser's tests need playwright")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed (apt install chromium)")

OPTIONS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
RESULTS = Path(__file__).parents[3] / "docs" / "results"
DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as api:
        browser = api.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def opened(browser):
    """A page that has been opened from disk and is ready; afterwards it must have been quiet."""

    @contextlib.contextmanager
    def visit(path, **context):
        context = browser.new_context(**{"viewport": DESKTOP, "reduced_motion": "reduce"} | context)
        page, said, asked = context.new_page(), [], []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready=true]")
        yield page
        assert said == []
        assert asked == [path.as_uri()]
        context.close()

    return visit


@pytest.fixture(scope="module")
def report(four, tmp_path_factory):
    path = tmp_path_factory.mktemp("pages") / "four.html"
    write_report([four], path, bibtex="@software{coachable}")
    return path


def until(page, expression, argument=None):
    """Wait until an expression is true. (Playwright's own way runs text, which the page's policy forbids.)"""
    for _ in range(400):
        if page.evaluate(expression, argument):
            return
        page.wait_for_timeout(25)
    raise AssertionError(f"never true: {expression}")


def stage(page):
    return page.eval_on_selector("#stage", "stage => ({...stage.dataset})")


def wait_for_walk(page):
    until(page, "document.getElementById('stage').dataset.time !== undefined")


def lit(page):
    return page.eval_on_selector_all(
        ".automaton-of:not([hidden]) g.lit", "all => all.map((g) => g.querySelector('.name').textContent)"
    )


def picture(page, canvas):
    return page.eval_on_selector(f"#{canvas}", "canvas => canvas.toDataURL()")


def seek(page, time):
    page.eval_on_selector(
        "#scrub", "(scrub, time) => { scrub.value = time; scrub.dispatchEvent(new Event('input')); }", time
    )


@pytest.mark.parametrize(
    ("setups", "seeds"),
    [(("orthant",), 1), (("sparse", "orthant"), 2), (None, 15), (None, 100)],
    ids=["1 lane", "4 lanes", "60 lanes", "400 lanes"],
)
def test_it_opens_quietly_with_any_number_of_lanes(make_run, opened, tmp_path, setups, seeds):
    chosen = {"setups": setups} if setups else {}
    run = make_run(tmp_path / "run", num_seeds=seeds, seconds=10.0 if seeds == 1 else 0.6, **chosen)
    path = tmp_path / "page.html"
    write_report([run], path, bibtex="")
    with opened(path) as page:
        wait_for_walk(page)
        lanes = seeds * len(setups or range(4))
        assert page.locator(".seed").count() == lanes
        assert page.locator(".seed[aria-disabled]").count() == max(0, lanes - 128)
        assert page.locator("#charts canvas").count() == 1
        assert page.locator(".claim").count() == 6
    assert path.stat().st_size < 3_000_000


def test_scrubbing_moves_the_walker_the_automaton_and_all_the_rest_together(report, four, opened):
    walks = pq.read_table(four / "trajectories.parquet").to_pandas()
    with opened(report) as page:
        wait_for_walk(page)
        walk = walks[walks.lane == stage(page)["lane"]].reset_index()
        names = ["O1", "O2", "O3", "O4", ""]
        before, canvases = {}, ("walker", "timeline", "portrait-1", "portrait-2")
        for row in (30, 111, 222, 300, 404):
            seek(page, float(walk.t[row]))
            now = stage(page)
            assert float(now["time"]) == pytest.approx(walk.t[row], abs=1e-3)
            assert now["phase"] == names[walk.phase[row]]
            assert lit(page) == [name for name in [now["phase"]] if name]
            assert page.inner_text("#phase") == (now["phase"] or "–")
            hip = walk.foot_x[row] - np.sin(walk.theta_1[row])
            assert float(now["metres"]) == pytest.approx(hip, abs=1e-3)
            assert page.inner_text("#clock") == f"{walk.t[row]:.2f} s · {hip:.2f} m".replace("-", "−")
            pictures = {canvas: picture(page, canvas) for canvas in canvases}
            assert all(pictures[canvas] != before.get(canvas) for canvas in canvases)
            before = pictures


def test_the_diagnostics_of_the_updates_open_as_small_charts(report, opened):
    with opened(report) as page:
        wait_for_walk(page)
        page.click("#updates summary")
        until(page, "document.querySelector('#update-charts canvas').clientWidth > 200")
        assert page.locator("#update-charts canvas").count() == 4
        titles = page.locator("#update-charts figcaption").all_inner_texts()
        assert titles == ["Approximate KL", "Clip fraction", "Explained variance", "Entropy"]


def test_it_plays_pauses_and_ends(report, opened):
    with opened(report) as page:
        wait_for_walk(page)
        seek(page, 1.0)
        page.click("#play")
        until(page, "Number(document.getElementById('stage').dataset.time) > 1.3")
        page.click("#play")
        paused = stage(page)
        page.wait_for_timeout(150)
        assert stage(page) == paused
        assert paused["playing"] == "false"
        page.select_option("#speed", "2")
        page.locator("#scrub").focus()
        page.keyboard.press("End")
        assert float(stage(page)["time"]) == pytest.approx(float(page.get_attribute("#scrub", "max")))
        seek(page, float(page.get_attribute("#scrub", "max")) - 0.2)
        page.click("#play")
        until(page, "document.getElementById('stage').dataset.playing === 'false'")


def test_the_keyboard_alone_is_enough(report, opened):
    with opened(report) as page:
        wait_for_walk(page)
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        reached = set()
        for _ in range(60):
            page.keyboard.press("Tab")
            reached.add(page.evaluate("document.activeElement.id || document.activeElement.className"))
        assert {"theme", "play", "scrub", "setup", "seed", "beside", "speed", "every-run"} <= reached
        assert any("seed" in name for name in reached)
        page.locator("#scrub").focus()
        page.keyboard.press("Home")
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Shift+ArrowRight")
        assert float(stage(page)["time"]) == pytest.approx(0.13)
        page.keyboard.press("Space")
        until(page, "Number(document.getElementById('stage').dataset.time) > 0.2")
        page.keyboard.press("Space")
        assert stage(page)["playing"] == "false"
        first = page.locator(".seeds .seed").first
        first.focus()
        page.keyboard.press("Enter")
        until(page, f"document.getElementById('stage').dataset.lane === '{first.get_attribute('data-lane')}'")


def test_a_seed_that_is_chosen_walks_and_others_can_stand_beside_it(report, opened):
    with opened(report) as page:
        wait_for_walk(page)
        for setup in ("sparse", "forward+orthant"):
            page.locator(f'.seed[data-lane="{setup}-0"]').click()
            until(page, f"document.getElementById('stage').dataset.lane === '{setup}-0'")
            assert page.input_value("#setup") == setup
        seek(page, 2.0)
        ghost = picture(page, "walker")
        page.select_option("#beside", "nobody")
        until(page, "before => document.getElementById('walker').toDataURL() !== before", ghost)
        page.select_option("#setup", "forward")
        until(page, "document.getElementById('stage').dataset.lane === 'forward-0'")
        assert float(stage(page)["time"]) == pytest.approx(2.0)


def test_the_gallery_shows_every_lane_farthest_first_with_falls_marked(report, four, opened):
    evaluations = pq.read_table(four / "evaluations.parquet").to_pandas()
    last = evaluations[evaluations.step == evaluations.step.max()].set_index("lane")
    with opened(report) as page:
        for seed in page.locator(".seed").all():
            own = last.loc[seed.get_attribute("data-lane")]
            assert f"{own.hip_x:.2f} m" in seed.inner_text()
            assert ("fell" in seed.inner_text()) == own.fell
            seed.scroll_into_view_if_needed()
        until(
            page,
            "[...document.querySelectorAll('.seed canvas')].every((c) => c.width !== 300"
            " && c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(Boolean))",
        )


def test_hovering_reads_the_values_of_the_curves(report, four, opened):
    evaluations = pq.read_table(four / "evaluations.parquet").to_pandas()
    with opened(report) as page:
        page.locator("#measure label", has_text=re.compile("^Distance$")).click()
        page.locator("#charts .u-over").hover(position={"x": 400, "y": 100})
        where = page.locator("#charts .legend .where")
        step = int(where.inner_text().removesuffix(" steps").replace(",", ""))
        at = evaluations[evaluations.step == step]
        legend = page.locator("#charts .legend").inner_text()
        for setup in ("sparse", "forward", "orthant", "forward+orthant"):
            value = at[at.lane == f"{setup}-0"].hip_x.item()
            assert re.search(rf"{re.escape(setup)} {value:.2f}\b", legend)
        page.locator("#charts [role=group]").focus()
        page.keyboard.press("ArrowLeft")
        assert where.inner_text() == "50,000 steps"


def test_switches_redraw_the_curves(report, opened):
    chart = "document.querySelector('#charts canvas').toDataURL()"
    with opened(report) as page:
        seen = {page.evaluate(chart)}
        for label in (
            "every seed",
            "the paper’s curves",
            "wall time",
            "Highest distance",
            "Survival",
            "Share in cycle",
        ):
            page.locator("#learning .tools label", has_text=label).click()
            page.wait_for_timeout(30)
            picture = page.evaluate(chart)
            assert picture not in seen
            seen.add(picture)


def test_it_starts_to_walk_in_view_unless_motion_is_unwanted(report, opened):
    for motion, moves in (("no-preference", True), ("reduce", False)):
        with opened(report, reduced_motion=motion) as page:
            wait_for_walk(page)
            page.locator("#walker").scroll_into_view_if_needed()
            page.wait_for_timeout(400)
            assert (float(stage(page)["time"]) > 0) == moves


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_and_follows_the_colour_scheme(report, opened, viewport, scheme):
    with opened(report, viewport=viewport, color_scheme=scheme) as page:
        wait_for_walk(page)
        assert page.evaluate("document.documentElement.scrollWidth") == viewport["width"]

        def background():
            shade = page.evaluate("getComputedStyle(document.body).backgroundColor")
            return "dark" if max(map(int, re.findall(r"\d+", shade))) < 128 else "light"

        assert background() == scheme
        drawn = picture(page, "walker")
        page.click("#theme")
        assert background() != scheme
        assert picture(page, "walker") != drawn


def test_on_paper_it_is_light_and_without_controls(report, opened):
    with opened(report, color_scheme="dark") as page:
        wait_for_walk(page)
        assert page.pdf().startswith(b"%PDF")
        page.emulate_media(media="print")
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        assert not page.locator(".bar").is_visible()
        assert not page.locator(".transport").is_visible()
        assert page.locator(".claim").first.is_visible()


def test_a_hostile_description_is_shown_and_not_run(make_run, script, opened, tmp_path):
    run = make_run(tmp_path / "run", behaviour=script, setups=("orthant",))
    path = tmp_path / "page.html"
    write_report([run, tmp_path / "<b>nowhere"], path, bibtex="</script><script>window.pwned = 1</script>")
    with opened(path) as page:
        wait_for_walk(page)
        seek(page, 0.8)
        assert page.evaluate("window.pwned") is None
        assert page.locator("img").count() == 0
        assert page.locator(".automaton .name").first.text_content() == "</script>"
        assert "<b>nowhere" in page.inner_text("[role=alert]")
        assert lit(page) == [name for name in [stage(page)["phase"]] if name]


def test_several_studies_stand_side_by_side(make_run, opened, tmp_path):
    runs = [
        make_run(tmp_path / name, num_seeds=2, seconds=3.0, semantics=name)
        for name in ("paper", "released-code")
    ]
    path = tmp_path / "page.html"
    write_report(runs, path, bibtex="")
    with opened(path) as page:
        wait_for_walk(page)
        assert page.locator("#charts canvas").count() == 2
        assert page.locator(".claim .answer").count() == 12
        page.select_option("#study", "1")
        until(page, "document.getElementById('stage').dataset.study === 'released-code semantics'")
        page.select_option("#beside", label="paper semantics: orthant, seed 0")
        assert page.locator(".automaton-of:visible").count() == 1
        assert "released-code" in html.unescape(page.inner_text(".opening"))


def test_a_study_under_way_shows_its_curves_and_says_what_is_missing(four, opened, tmp_path):
    run = shutil.copytree(four, tmp_path / "run")
    manifest = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps(manifest | {"status": "interrupted", "files": {}}))
    (run / "trajectories.parquet").unlink()
    path = tmp_path / "page.html"
    write_report([run], path, bibtex="")
    with opened(path) as page:
        assert "interrupted" in page.inner_text("[role=status]")
        assert page.locator("#charts canvas").count() == 1
        assert page.locator("#no-walks").is_visible()
        assert not page.locator("#stage").is_visible()
        assert page.locator(".seed").count() == 4
        assert page.locator(".seed canvas").count() == 0
        assert page.inner_text("#seeds-note").startswith("The latest evaluation")


def test_without_scripts_claims_and_numbers_are_there(report, browser):
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(report.as_uri())
    assert page.locator(".claim .verdict").count() == 6
    assert page.locator("#numbers table").count() == 7
    assert page.locator("noscript").count() == 1
    context.close()


def test_a_robot_without_a_plant_has_curves_and_tables_alone(opened, tmp_path):
    path = tmp_path / "page.html"
    write_report([RESULTS / "walker2d" / "hop"], path, bibtex="")
    with opened(path) as page:
        assert page.inner_text("h1") == "What Walker2d-v5 learned"
        assert page.locator("#charts canvas").count() == 1
        assert not page.locator("#paper-curves").is_visible()
        assert page.locator("#description .automaton").is_visible()
        seen = {page.evaluate("document.querySelector('#charts canvas').toDataURL()")}
        for title in ("Share in cycle", "Episode's length", "Return in training"):
            page.locator("#measure label", has_text=title).click()
            seen.add(page.evaluate("document.querySelector('#charts canvas').toDataURL()"))
        assert len(seen) == 4
        assert page.evaluate("document.documentElement.scrollWidth") == DESKTOP["width"]
        assert page.pdf().startswith(b"%PDF")


def test_beside_a_plant_a_robot_shares_the_measures_that_both_have(four, opened, tmp_path):
    path = tmp_path / "page.html"
    write_report([four, RESULTS / "walker2d" / "hop"], path, bibtex="")
    with opened(path) as page:
        wait_for_walk(page)
        for title, charts in (("Normalised reward", 1), ("Share in cycle", 2), ("Environment's return", 1)):
            page.locator("#measure label", has_text=title).click()
            assert page.locator("#charts canvas").count() == charts
        assert page.locator(".seed").count() == 4
        assert page.locator("#study option").count() == 1
