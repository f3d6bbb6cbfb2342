"""Assignments that are wrong, by what is wrong: the file, and a part of the complaint."""

HEAD = (
    'kind = "assignment"\nformat = 1\ntitle = "T"\nrobot = "planar2r"\n'
    'start = "ready"\npanels = ["joints", "motion"]\n'
)
STEP = '[[step]]\ntitle = "one"\ntext = "some words"\npanel = "joints"\n'
JOINTS = '[[step.goal]]\ntext = "a"\njoints = ["pi/2", 0]\n'
POSE = '[[step.goal]]\ntext = "b"\npoints = 2\npose = { xyz = [0.5, 0.4, 0.0] }\n'
MOTION = '[[step.goal]]\ntext = "c"\nmotion = { from = "ready", to = "zero", duration = 1.0 }\n'
SCORE = '[[step.goal]]\ntext = "d"\nown = { function = "fk", share = 0.5 }\n'
GOOD = HEAD + STEP + JOINTS + POSE + MOTION + SCORE
"""An assignment of one step with a goal of each kind."""

ROBOT = 'robot = "planar2r"'
BAD = {
    "mistyped key": (
        GOOD.replace("title", "titel", 1),
        "unknown key 'titel'; did you mean 'title'?",
    ),
    "unknown key": (
        GOOD.replace("format", "colour = 3\nformat", 1),
        "unknown key 'colour'; expected one of kind, format",
    ),
    "mistyped key of a goal": (
        GOOD.replace("points", "point"),
        "step 1: goal 2: unknown key 'point'; did you mean 'points'?",
    ),
    "mistyped key of a motion": (
        GOOD.replace("duration", "durations"),
        "step 1: goal 3: motion: unknown key 'durations'; did you mean 'duration'?",
    ),
    "goal outside a step": (
        HEAD + JOINTS.replace("step.goal", "goal") + STEP,
        "unknown key 'goal'",
    ),
    "no title": (GOOD.replace('title = "T"\n', ""), "key 'title' is missing"),
    "no kind": (GOOD.replace('kind = "assignment"\n', ""), "key 'kind' is missing"),
    "another kind": (
        GOOD.replace('"assignment"', '"exam"'),
        "kind: found 'exam'; expected 'assignment'",
    ),
    "another format": (GOOD.replace("format = 1", "format = 2"), "format: found 2; expected 1"),
    "unknown panel": (
        GOOD.replace('"motion"]', '"motions"]'),
        "panels[1]: no panel 'motions'; did you mean 'motion'?",
    ),
    "unknown panel, far off": (
        GOOD.replace('"motion"]', '"cake"]'),
        "panels[1]: no panel 'cake'; expected one of joints, tool,",
    ),
    "panel of a step": (
        GOOD.replace('panel = "joints"', 'panel = "task"'),
        "step 1: panel: no panel 'task'",
    ),
    "panel that is not shown": (
        GOOD.replace('panel = "joints"', 'panel = "tool"'),
        "step 1: panel: found 'tool'; expected one that panels lists",
    ),
    "no panels": (
        GOOD.replace('["joints", "motion"]', "[]"),
        "panels: found 0 entries; expected at least 1",
    ),
    "panels of another type": (
        GOOD.replace('["joints", "motion"]', '"joints"'),
        "panels: found 'joints'; expected a list",
    ),
    "unknown robot": (GOOD.replace(ROBOT, 'robot = "pumma560"'), "robot: "),
    "path outside": (
        GOOD.replace(ROBOT, 'robot = "../arm.toml"'),
        "robot: '../arm.toml' leaves the assignment's folder",
    ),
    "absolute path": (
        GOOD.replace(ROBOT, 'robot = "/etc/arm.toml"'),
        "leaves the assignment's folder",
    ),
    "no such robot file": (GOOD.replace(ROBOT, 'robot = "arm.toml"'), "no such file"),
    "name with a NUL": (GOOD.replace(ROBOT, r'robot = "a\u0000.toml"'), "is not a file name"),
    "itself as robot": (GOOD.replace(ROBOT, 'robot = "task.toml"'), "robot: "),
    "robot with an escape": (GOOD.replace(ROBOT, r'robot = "a\u001b[31m"'), "robot: "),
    "robot of another type": (GOOD.replace(ROBOT, "robot = 560"), "robot: found 560; expected "),
    "unknown start": (
        GOOD.replace('start = "ready"', 'start = "redy"'),
        "start: planar2r has no configuration 'redy'; expected zero, ready, or a list",
    ),
    "start of three": (
        GOOD.replace('start = "ready"', "start = [0, 0, 0]"),
        "start: found 3 joint values; expected 2 for planar2r",
    ),
    "21 steps": (HEAD + 21 * STEP, "step: found 21 entries; expected at most 20"),
    "21 goals": (HEAD + STEP + 21 * JOINTS, "step 1: goal: found 21 entries; expected at most 20"),
    "no steps": (HEAD, "key 'step' is missing"),
    "steps of another type": (HEAD + 'step = "one"\n', "step: found 'one'; expected a list"),
    "long text": (
        GOOD.replace("some words", 4001 * "x"),
        "step 1: text: found 4001 characters; expected at most 4000",
    ),
    "long title": (
        GOOD.replace('"one"', f'"{201 * "x"}"'),
        "step 1: title: found 201 characters; expected at most 200",
    ),
    "title of two lines": (
        GOOD.replace('"one"', r'"one\ntwo"'),
        "step 1: title: found several lines; expected one",
    ),
    "empty title": (
        GOOD.replace('"one"', '" "'),
        "step 1: title: found an empty text; expected words",
    ),
    "control character": (
        GOOD.replace("some words", r"some \u001b[31m words"),
        "step 1: text: found the control character U+001B",
    ),
    "text that turns its direction": (
        GOOD.replace("some words", r"some \u202e words"),
        "found the control character U+202E",
    ),
    "number for a text": (GOOD.replace('"some words"', "3"), "step 1: text: found 3; expected "),
    "two conditions": (
        GOOD.replace('text = "a"', 'text = "a"\nown = { function = "ik" }'),
        "step 1: goal 1: found joints and own; expected exactly one of pose, joints, motion, own",
    ),
    "no condition": (
        GOOD.replace('joints = ["pi/2", 0]', ""),
        "step 1: goal 1: found none; expected exactly one of",
    ),
    "NaN": (
        GOOD.replace("[0.5, 0.4, 0.0]", "[nan, 0.4, 0.0]"),
        "step 1: goal 2: pose.xyz[0]: found nan; expected a finite number",
    ),
    "infinite": (
        GOOD.replace("[0.5, 0.4, 0.0]", "[0.5, -inf, 0.0]"),
        "pose.xyz[1]: found -inf; expected a finite number",
    ),
    "huge number": (
        GOOD.replace("[0.5, 0.4, 0.0]", f"[{300 * '9'}, 0, 0]"),
        "expected a finite number of at most 10000",
    ),
    "number beyond a double": (
        GOOD.replace("[0.5, 0.4, 0.0]", f"[{700 * '9'}, 0, 0]"),
        "beyond the range of a double",
    ),
    "pose of two": (
        GOOD.replace("[0.5, 0.4, 0.0]", "[0.5, 0.4]"),
        "step 1: goal 2: pose.xyz: found 2 entries; expected at least 3",
    ),
    "true for a number": (
        GOOD.replace("[0.5, 0.4, 0.0]", "[true, 0, 0]"),
        "found True; expected a number, or an expression in quotes",
    ),
    "unreachable pose": (
        GOOD.replace("[0.5, 0.4, 0.0]", "[0.9, 0.4, 0.0]"),
        "step 1: goal 2: pose: 0.9849 m from the base; expected at most 0.9 m, the arm's reach",
    ),
    "order of angles": (
        GOOD.replace("0.0] }", '0.0], order = "XXY" }'),
        "pose.order: found 'XXY'; expected one of XYZ",
    ),
    "code for a number": (
        GOOD.replace('"pi/2"', "\"__import__('os').system('touch hacked')\""),
        "step 1: goal 1: joints: found ",
    ),
    "too many joints": (
        GOOD.replace('["pi/2", 0]', "[0, 0, 0]"),
        "step 1: goal 1: joints: found 3 joint values; expected 2 for planar2r",
    ),
    "joints beyond a list": (
        GOOD.replace('["pi/2", 0]', str([0] * 33)),
        "expected a configuration's name, or a list of joint values",
    ),
    "joints beyond limits": (
        GOOD.replace('["pi/2", 0]', "[4, 0]"),
        "joints: shoulder is 4; expected -3.142 to 3.142, its limits",
    ),
    "motion to nowhere": (
        GOOD.replace('to = "zero"', 'to = "home"'),
        "step 1: goal 3: motion.to: planar2r has no configuration 'home'",
    ),
    "motion without an end": (
        GOOD.replace('to = "zero", ', ""),
        "step 1: goal 3: motion: key 'to' is missing",
    ),
    "motion that stays": (
        GOOD.replace('to = "zero"', 'to = "ready"'),
        "motion: it ends where it begins; expected two configurations",
    ),
    "motion without time": (
        GOOD.replace("duration = 1.0", "duration = 0"),
        "motion.duration: found 0",
    ),
    "unknown function": (
        GOOD.replace('"fk"', '"jacobian"'),
        "own.function: found 'jacobian'; expected 'fk', 'ik' or 'controller'",
    ),
    "more than everything": (
        GOOD.replace("share = 0.5", "share = 1.5"),
        "own.share: found 1.5; expected less than or equal to 1",
    ),
    "negative points": (
        GOOD.replace("points = 2", "points = -2"),
        "step 1: goal 2: points: found -2; expected greater than or equal to 0",
    ),
    "points as text": (
        GOOD.replace("points = 2", 'points = "2"'),
        "points: found '2'; expected a number",
    ),
    "tolerance of another type": (
        GOOD.replace('text = "b"', 'text = "b"\ntolerance = 0.1'),
        "step 1: goal 2: tolerance: found 0.1; expected a table",
    ),
    "mistyped tolerance": (
        GOOD.replace('text = "b"', 'text = "b"\ntolerance = { positon = 0.1 }'),
        "goal 2: tolerance: unknown key 'positon'; did you mean 'position'?",
    ),
    "no TOML": ("kind = assignment", "not TOML: "),
    "no text": (b"\xff\xfe" + GOOD.encode(), "codec can't decode"),
    "nested": ("a = " + 2000 * "[" + 2000 * "]", "nested too deep"),
    "huge file": (GOOD + "#" + 100_000 * "x", "more than 0.1 MB; expected an assignment"),
}
