"""The findings as a table, as JSON and as one page of HTML."""

import html
import json
from pathlib import Path

import meshes
import picture

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; color: #222 }
table { border-collapse: collapse; width: 100% }
td, th { text-align: left; padding: .15rem .6rem; border-bottom: 1px solid #ddd }
.failed td { background: #fdd } figure { display: inline-block; margin: .5rem }
figcaption { font-size: 13px; text-align: center } pre { white-space: pre-wrap; font-size: 12px }
"""
STATES = {True: "ok", False: "FAILED", None: "-"}
PICTURED = ("full", "front", "view", "decimate")


def table(findings):
    """Plain text, one line to a finding."""
    columns = ("case", "claim", "expected", "found")
    clip = {"case": 14, "claim": 44, "expected": 24, "found": 48}
    lines = []
    for finding in findings:
        cells = [str(finding[c])[: clip[c]].ljust(clip[c]) for c in columns]
        lines.append("  ".join([STATES[finding["passed"]].ljust(6), *cells]).rstrip())
    return "\n".join(lines)


def results(findings):
    """What the driver reads."""
    counts = [sum(f["passed"] is state for f in findings) for state in (True, False, None)]
    return dict(zip(("passed", "failed", "not_offered"), counts), findings=findings)


def summary(outcome):
    """The outcome in a line."""
    text = f"{outcome['passed']} claims hold, {outcome['failed']} do not"
    absent = outcome["not_offered"]
    return text + (f", {absent} could not be made yet" if absent else "")


def write(plan, findings, folder):
    """Writes results.json and report.html."""
    folder = Path(folder)
    outcome = results(findings)
    (folder / "results.json").write_text(json.dumps(outcome, indent=1) + "\n")
    (folder / "report.html").write_text(page(plan, outcome), encoding="utf-8")


def page(plan, outcome):
    """The whole report; pictures are part of it."""
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8><title>Conformance</title>",
        f"<style>{STYLE}</style><h1>Conformance</h1><p>{summary(outcome)}. Judged by trimesh, NumPy, SciPy.</p>",
    ]
    for case in plan["cases"]:
        findings = [f for f in outcome["findings"] if f["case"] == case["name"]]
        parts.append(f"<h2>{html.escape(case['name'])}</h2>")
        parts += [_figure("input", case["input"])]
        parts += [_figure(_caption(s), s["output"]) for s in case["steps"] if _pictured(s)]
        parts.append("<table><tr><th>claim<th>expected<th>found<th></tr>")
        for f in findings:
            style = ' class="failed"' if f["passed"] is False else ""
            cells = "".join(f"<td>{html.escape(f[c])}" for c in ("claim", "expected", "found"))
            parts.append(f"<tr{style}>{cells}<td>{STATES[f['passed']]}</tr>")
        commands = html.escape("\n".join(s["command"] for s in case["steps"]))
        parts.append(f"</table><details><summary>commands</summary><pre>{commands}</pre></details>")
    return "\n".join(parts) + "\n</html>\n"


def _pictured(step):
    return step["kind"] in PICTURED and step["exit"] == 0 and step["output"]


def _caption(step):
    return f"{step['kind']} {step.get('asked', '')}".strip()


def _figure(caption, path):
    try:
        mesh = meshes.load(path)
        source = picture.data_url(picture.draw(mesh))
    except (ValueError, OSError, IndexError) as error:
        return f"<figure><figcaption>{html.escape(f'{caption}: {error}')}</figcaption></figure>"
    text = html.escape(f"{caption}: {len(mesh.faces)} triangles")
    return f'<figure><img src="{source}" alt="{text}"><figcaption>{text}</figcaption></figure>'
