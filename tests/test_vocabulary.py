"""Reject retired names; docs/glossary.md has the terms to use instead."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILES = sorted(
    path for folder in ("terrainkit", "robots", "cli") for path in (ROOT / folder).rglob("*.py")
)

RETIRED = {
    "Asked": "EvaluationConfig",
    "AuditFinding": "Issue",
    "BroughtIn": "OnboardResult",
    "CapacityError": "MemoryLimitError",
    "Careers": "TerrainCurriculum",
    "Curves": "rsl-rl's Logger",
    "Defect": "Violation",
    "Differences": "RandomizedParams",
    "Earnings": "reward totals of the environment",
    "Film": "VideoSpec",
    "Given": "SpecOverride",
    "IdleComment": "unused suppression",
    "Ignored": "Suppressed",
    "Limits": "msgspec.Meta",
    "Onboarded": "RobotFiles",
    "Orders": "VelocityCommand",
    "Outcome": "RolloutMetrics",
    "Patient": "Mutant",
    "Plant": "SimModel",
    "Played": "PlayResult",
    "Proof": "Verification",
    "Registered": "RegisteredTask",
    "Section": "Config",
    "Stage": "a mujoco.Renderer",
    "Studio": "a mujoco.Renderer",
    "TaskSpec": "RegisteredTask",
    "TerrainChoice": "SubTerrain",
    "Trained": "TrainResult",
    "Trial": "Rollout",
    "Trials": "EvaluationRollout",
    "Wish": "GainTarget",
    "Wishes": "OnboardOptions",
    "agreement": "equivalence",
    "apart": "pose_error",
    "at_zero": "zero_pose",
    "audit": "validate",
    "begin": "reset",
    "begin_all": "reset",
    "bring_in": "onboard",
    "bringing_in": "pipeline",
    "capacity": "memory",
    "careers": "curriculum",
    "carried": "composite_inertia",
    "choose": "select_rules",
    "coarser": "decimate",
    "combined": "merged_inertia",
    "drive": "actuator",
    "earnings": "reward totals of the environment",
    "facts_record": "facts_json",
    "find": "get_terrain, get_preset, get_rule, get_task, ...",
    "followers": "mimic_joints",
    "forget": "reset",
    "fused": "fixed_joint_merge",
    "ground": "terrain",
    "hold_commands": "set_commands",
    "is_applicable": "has_inputs",
    "joint_uses": "joint_roles",
    "keeps_out": "is_blocking",
    "leftovers": "unsupported",
    "let_fall": "drop_test",
    "markup": "xml",
    "normal_form": "canonical",
    "part_cache": "decomposition_cache",
    "pay": "compute",
    "per_robot": "a cached property of Facts",
    "plant": "sim_model",
    "plot": "grid",
    "proof": "verify",
    "prove": "verify",
    "require_memory": "check_memory",
    "require_room": "check_memory",
    "room": "memory",
    "rooted": "base_link",
    "smallest_ball": "bounding_sphere",
    "sound_inertia": "valid_inertia",
    "stage": "rendering",
    "step_size": "time_step",
    "studio": "rendering",
    "summed_up": "summarize",
    "tile": "make_patch",
    "timetable": "command_schedule",
    "told": "to_ctrl",
    "treat": "simplify",
    "treatment": "simplify",
    "twins": "mirror_pairs",
    "unasked": "has_inputs",
    "unread": "unparsed",
    "wanted": "expected",
    "wording": "text",
    "wrapped": "wrap_to_pi",
}
"""The term to use instead of each retired name of a module, class, function, argument or field."""


def names(path):
    yield path.stem
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id
        elif isinstance(node, ast.arg):
            yield node.arg


def test_names_are_not_retired():
    retired = {
        f"{path.relative_to(ROOT)}: {name}": RETIRED[name.strip("_")]
        for path in FILES
        for name in names(path)
        if name.strip("_") in RETIRED
    }
    assert FILES
    assert not retired


def test_retired_name_is_found(tmp_path):
    (tmp_path / "a.py").write_text("class Careers:\n    def _told(self, plot): ...\n")
    assert set(names(tmp_path / "a.py")) >= {"Careers", "_told", "plot"}
