"""The judge of conformance runs.

    judge.py judge PLAN FOLDER   judges what the plan lists; leaves results.json and report.html
    judge.py write MESH FOLDER   writes a mesh in each of trimesh's formats; prints the files
    judge.py paint MESH FOLDER   writes a mesh with colours of vertices; prints the file

The plan is written by `cargo xtask conformance`. Exit code 0 if every claim holds, else 1.
"""

import json
import logging
import sys
from pathlib import Path

import claims
import meshes
import report


def main(arguments):
    """Runs one of the commands; returns the exit code."""
    # trimesh logs what it repairs or cannot read; here that is for the claims to say.
    logging.getLogger("trimesh").setLevel(logging.ERROR)
    command, source, folder = (arguments + [""] * 3)[:3]
    if command == "write" and folder:
        for file in meshes.write_formats(meshes.load(source), folder):
            print(file)
        return 0
    if command == "paint" and folder:
        print(meshes.write_painted(meshes.load(source), folder))
        return 0
    if command == "judge" and folder:
        plan = json.loads(Path(source).read_text())
        findings = [finding for case in plan["cases"] for finding in claims.judge(case)]
        report.write(plan, findings, folder)
        outcome = report.results(findings)
        print(report.table(findings))
        print(report.summary(outcome))
        return 1 if outcome["failed"] else 0
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
