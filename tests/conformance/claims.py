"""The claims about each step of a case, and what the judge finds."""

from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Optional

import distance
import meshes
import sameness
import topology

# A front's count may differ from the one asked for by this share: splits come in groups.
FRONT_TOLERANCE = 0.05
# What a program says of a command or an option that it does not have yet.
NOT_OFFERED = ("not available yet", "unrecognized subcommand")
# Compact positions, as a share of the box diagonal.
COMPACT_ERROR = 2e-4


@dataclass
class Finding:
    """One claim and its outcome, in words."""

    case: str
    claim: str
    expected: str
    found: str
    # None where the program says that it does not offer this yet: nothing is claimed then.
    passed: Optional[bool]


@lru_cache(maxsize=8)
def _load(path):
    return meshes.load(path)


class Case:
    """One mesh's claims: what the input is, and what must hold of all that comes of it."""

    def __init__(self, plan):
        self.plan = plan
        self.findings = []
        self.input = meshes.weld(meshes.load(plan["input"]))
        self.facts = topology.describe(self.input)
        self.repaired = {}
        self.coarsest = 0
        # Files that were not made, with good reason: nothing that needs them is judged.
        self.absent = set()

    def judge(self):
        """Judges the input and each step; returns the findings."""
        self._judge_input()
        for step in self.plan["steps"]:
            self._judge_step(step)
        return self.findings

    def _claim(self, claim, expected, found, passed=None):
        passed = expected == found if passed is None else bool(passed)
        self.findings.append(Finding(self.plan["name"], claim, str(expected), str(found), passed))

    def _judge_input(self):
        nature, facts = self.plan["nature"], self.facts
        if nature == "closed":
            self._claim("input is a closed manifold", True, facts.closed)
            self._claim("input's Euler number", self.plan["euler"], facts.euler)
            self._claim("input's volume is positive", "> 0", f"{facts.volume:.6g}", facts.volume > 0)
        elif nature == "open":
            self._claim("input is a manifold", True, facts.manifold)
            edges = facts.boundary_edges
            self._claim("input has a boundary", "> 0", edges, edges > 0)

    def _judge_step(self, step):
        kind, exit_code = step["kind"], step["exit"]
        name = _step_name(step)
        message = step["message"].strip().splitlines()
        last = message[-1] if message else ""
        arguments = step["arguments"]
        if self.absent.intersection(arguments):
            return
        if exit_code != 0 and any(text in step["message"] for text in NOT_OFFERED):
            if kind in ("build", "decimate"):
                self.absent.add(arguments[2])
            self.findings.append(Finding(self.plan["name"], name, "", "not offered yet", None))
            return
        if self.plan["nature"] == "dirty" and kind == "build" and exit_code == 1:
            said = last.startswith("error:")
            self._claim(f"{name}: refused with a reason", "error: …", last, said)
            self.absent.add(arguments[2])
            return
        if exit_code != 0:
            reason = last or "no message"
            if kind == "build":
                # Said once; not again by all that needs the file.
                self.absent.add(arguments[2])
            self._claim(f"{name}: done", "exit 0", f"exit {exit_code}: {reason}", False)
            return
        judge = getattr(self, f"_judge_{kind}")
        try:
            if step["output"] is None:
                judge(name, step)
            else:
                mesh = _load(step["output"])
                judge(name, step, mesh)
        except Exception as error:  # A report or a file that is not as agreed.
            self._claim(f"{name}: can be judged", "yes", f"{type(error).__name__}: {error}", False)

    def _judge_build(self, name, step):
        report = step["report"]
        found = report["input_triangles"]
        # Of a file in another format the count is the same.
        self._claim(f"{name}: triangles read", self.facts.triangles, found)
        self.coarsest = report.get("base_triangles", 0)
        self.repaired = {k: n for k, n in (report.get("repaired") or {}).items() if n}

    def _judge_verify(self, name, step):
        self._claim(f"{name}: ok", True, step["report"]["ok"])

    _judge_against = _judge_verify

    def _judge_full(self, name, step, mesh):
        if not self.facts.manifold:
            self._judge_repaired(name, mesh)
            return
        self._same_triangles(name, mesh)
        self._same_topology(name, topology.describe(mesh), "volume")

    def _judge_repaired(self, name, mesh):
        """Nothing lost silently, and a manifold whatever came in."""
        facts = topology.describe(mesh)
        differing = sameness.differing_triangles(self.input, mesh)
        silent = differing > 0 and not self.repaired
        found = f"{differing} differ, repaired {self.repaired}"
        self._claim(f"{name}: no triangle lost silently", "none or reported", found, not silent)
        self._claim(f"{name}: a manifold", True, facts.manifold)

    def _judge_front(self, name, step, mesh):
        facts = topology.describe(mesh)
        # No front is coarser than the coarsest mesh.
        asked = max(step["asked"], self.coarsest)
        near = abs(facts.triangles - asked) <= max(2, FRONT_TOLERANCE * asked)
        self._claim(f"{name}: count", f"about {asked}", facts.triangles, near)
        self._judge_view(name, step, mesh)

    def _judge_view(self, name, step, mesh):
        facts = topology.describe(mesh)
        self._claim(f"{name}: count reported", facts.triangles, step["report"]["output_triangles"])
        if self.facts.manifold:
            self._same_topology(name, facts)
        else:
            self._claim(f"{name}: a manifold", True, facts.manifold)

    def _judge_compact(self, name, step, mesh):
        facts = topology.describe(mesh)
        limit = COMPACT_ERROR * self.facts.diagonal
        if self.facts.manifold:
            self._claim(f"{name}: triangles", self.facts.triangles, facts.triangles)
            self._same_topology(name, facts)
            apart = sameness.vertex_distance(self.input, mesh)
            self._claim(f"{name}: position error", f"<= {limit:.3g}", f"{apart:.3g}", apart <= limit)
        else:
            self._claim(f"{name}: a manifold", True, facts.manifold)

    def _judge_decimate(self, name, step, mesh):
        facts = topology.describe(mesh)
        missed = step["report"].get("missed")
        exact = facts.triangles == step["asked"] or bool(missed)
        found = f"{facts.triangles}, missed {missed}" if missed else facts.triangles
        self._claim(f"{name}: exact count, or said why not", step["asked"], found, exact)
        if not self.facts.manifold:
            return
        self._same_topology(name, facts)
        if self.facts.closed:
            drift = abs(facts.volume / self.facts.volume - 1)
            self._claim(f"{name}: volume drift", "<= 1 %", f"{100 * drift:.3f} %", drift <= 0.01)

    def _judge_diff(self, name, step, mesh):
        """Ours against an independent sampler; a thousand samples tell a mean within a tenth."""
        pairs = {"a_to_b": (self.input, mesh), "b_to_a": (mesh, self.input)}
        for key, (start, end) in pairs.items():
            ours, theirs = step["report"][key], distance.one_sided(start, end)
            for what in ("mean", "rms"):
                near = abs(ours[what] - theirs[what]) <= 0.1 * theirs[what]
                self._claim(
                    f"{name} {key}: {what}", f"{theirs[what]:.4g} ± 10 %", f"{ours[what]:.4g}", near
                )

    def _judge_read(self, name, step, mesh):
        # Against trimesh's reading of the same file: text has fewer digits than the input.
        written = meshes.weld(_load(step["output"][: -len(".ply")]))
        differing = sameness.differing_triangles(written, mesh)
        self._claim(f"{name}: differing triangles", 0, differing)

    def _judge_write(self, name, step, mesh):
        self._same_triangles(name, mesh)

    def _judge_colours(self, name, step, mesh):
        """The same colours at the same places, as trimesh reads both files."""
        painted, found = (meshes.load_painted(f) for f in (step["painted"], step["output"]))
        if step["output"].endswith(".obj"):
            # Which has no fourth component.
            painted, found = painted[:, :6], found[:, :6]
        if step["everywhere"]:
            same = painted.shape == found.shape and bool((painted == found).all())
            self._claim(f"{name}: colours of {len(painted)} vertices", "the same", same, same)
        else:
            known = set(map(bytes, painted))
            strange = sum(bytes(row) not in known for row in found)
            self._claim(f"{name}: vertices with other colours", 0, strange)

    def _same_triangles(self, name, mesh):
        differing = sameness.differing_triangles(self.input, mesh)
        self._claim(f"{name}: differing triangles", 0, differing)

    def _same_topology(self, name, facts, *also):
        """The input's topology; by one claim, which names what is otherwise."""
        wanted, found = self.facts, facts
        keys = ["euler", "components", "watertight", "winding"]
        keys += ["edge_manifold", "vertex_manifold", "degenerate"]
        wrong = [k for k in keys if getattr(wanted, k) != getattr(found, k)]
        kind = "closed" if wanted.closed else "manifold"
        expected = f"{kind}, Euler {wanted.euler}"
        text = ", ".join(f"{k} {getattr(found, k)}" for k in wrong) or expected
        self._claim(f"{name}: topology", expected, text, not wrong)
        for key in also:
            one, other = getattr(wanted, key), getattr(found, key)
            # Numbers in text may be finer than single precision.
            near = abs(one - other) <= 1e-6 * max(abs(one), abs(other))
            self._claim(f"{name}: {key}", f"{one:.9g}", f"{other:.9g}", near)


def _step_name(step):
    """A short name: the kind, and what was asked for or which file it is about."""
    if "asked" in step:
        return f"{step['kind']} {step['asked']}"
    if step["kind"] in ("read", "write"):
        file = step["output"].rsplit("/", 1)[-1]
        return f"{step['kind']} {file[: -len('.ply')] if step['kind'] == 'read' else file}"
    if step["kind"] == "build":
        return "build " + step["arguments"][2].rsplit("/", 1)[-1]
    if step["kind"] in ("full", "view", "colours"):
        return f"{step['kind']} {step['output'].rsplit('/', 1)[-1]}"
    return step["kind"]


def judge(plan):
    """The findings of one case, as plain dictionaries."""
    try:
        findings = Case(plan).judge()
    except Exception as error:  # Whatever it is, the other cases are still to be judged.
        found = f"{type(error).__name__}: {error}"
        findings = [Finding(plan["name"], "input can be judged", "yes", found, False)]
    return [asdict(finding) for finding in findings]
