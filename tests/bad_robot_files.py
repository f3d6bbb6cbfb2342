"""Robot files that describe no robot, each with what its refusal must say."""

JOINT = """
[[joint]]
name = "elbow"
type = "revolute"
a = 0.5
alpha = 0
d = 0
theta = 0
"""
HEAD = """
format = 1
name = "bad"
convention = "standard"
"""
GOOD = HEAD + JOINT
BODY = "body = { mass = 1, com = [0, 0, 0], inertia = { xx = 1, yy = 1, zz = 1 } }\n"


def changed(old: str, new: str, text: str = GOOD) -> str:
    assert old in text
    return text.replace(old, new)


BAD = {
    "wrong type": (
        changed("a = 0.5", "a = [1]"),
        r"joint 1 \(elbow\): a: found \[1\]; expected a number",
    ),
    "boolean": (changed("a = 0.5", "a = true"), "expected a number"),
    "date": (changed("a = 0.5", "a = 2020-01-01"), "expected a number"),
    "text where a table belongs": (GOOD + 'body = "heavy"', "body: .*expected a table"),
    "unknown joint key": (
        changed("alpha", "alfa"),
        "unknown key 'alfa'; did you mean 'alpha'|key 'alpha' is missing",
    ),
    "unknown top key": (changed("format = 1", "format = 1\nauthor = 'x'"), "unknown key 'author'"),
    "unknown body key": (GOOD + changed("mass", "weight", BODY), "body"),
    "unknown inertia key": (GOOD + changed("zz = 1", "zz = 1, ixx = 2", BODY), "unknown key 'ixx'"),
    "missing theta": (changed("theta = 0\n", ""), r"joint 1 \(elbow\): key 'theta' is missing"),
    "missing format": (changed("format = 1", ""), "key 'format' is missing"),
    "missing name": (changed('name = "bad"', ""), "key 'name' is missing"),
    "missing convention": (changed('convention = "standard"', ""), "key 'convention' is missing"),
    "missing mass": (GOOD + "body = { com = [0, 0, 0] }", "body: key 'mass' is missing"),
    "NaN": (changed("a = 0.5", "a = nan"), "a: .*not finite"),
    "infinity": (changed("a = 0.5", "a = inf"), "a: .*not finite"),
    "minus infinity": (changed("a = 0.5", "a = -inf"), "a: .*not finite"),
    "1e400": (changed("a = 0.5", "a = 1e400"), "beyond the range of a double"),
    "1e400 in quotes": (changed("a = 0.5", 'a = "1e400"'), "beyond the range of a double"),
    "a huge exponent": (
        changed("a = 0.5", "a = 1e99999999999999999999"),
        "beyond the range of a double",
    ),
    "a long integer": (changed("a = 0.5", "a = 1" + "0" * 5000), "not TOML|beyond the range"),
    "negative mass": (
        GOOD + changed("mass = 1", "mass = -1", BODY),
        r"body.mass is -1 kg; expected none below 0",
    ),
    "impossible inertia": (GOOD + changed("xx = 1", "xx = -1", BODY), "eigenvalue -1 kg m"),
    "impossible products": (GOOD + changed("xx = 1", "xx = 1, xy = 2", BODY), "eigenvalue -1 kg m"),
    "six-list inertia": (
        GOOD + "body = { mass = 1, inertia = [1, 0, 0, 1, 0, 1] }",
        "inertia: .*order plain lists",
    ),
    "unsymmetric inertia": (
        GOOD + "body = { mass = 1, inertia = [[1, 2, 0], [0, 1, 0], [0, 0, 1]] }",
        "inertia: .*symmetric matrix",
    ),
    "com of two": (
        GOOD + changed("com = [0, 0, 0]", "com = [0, 0]", BODY),
        "com: found 2 entries; expected at least 3",
    ),
    "body and bodies": (
        GOOD + BODY + "bodies = [{ mass = 1 }]",
        r"joint 1 \(elbow\): found both body and bodies; expected one of them",
    ),
    "no bodies": (
        GOOD + "bodies = []",
        r"joint 1 \(elbow\): bodies: found 0 entries; expected at least 1",
    ),
    "17 bodies": (
        GOOD + f"bodies = [{'{ mass = 1 }, ' * 17}]",
        "bodies: found 17 entries; expected at most 16",
    ),
    "bodies of one name": (
        GOOD + 'bodies = [{ name = "rod", mass = 1 }, { name = "rod", mass = 2 }]',
        r"joint 1 \(elbow\): name 'rod' is another body's already",
    ),
    "a body with the default name of another": (
        GOOD + 'bodies = [{ name = "body 2", mass = 1 }, { mass = 2 }]',
        "name 'body 2' is another body's already",
    ),
    "bodies as a table": (GOOD + "bodies = { mass = 1 }", "bodies: found .*expected list"),
    "a body that is a number": (GOOD + "bodies = [1]", r"bodies\[0\]: found 1; expected a table"),
    "a body name that is a number": (
        GOOD + "bodies = [{ name = 1, mass = 1 }]",
        r"bodies\[0\].name: found 1; expected",
    ),
    "a body name with a slash": (
        GOOD + 'bodies = [{ name = "a/b", mass = 1 }]',
        "body 1 has the name 'a/b'",
    ),
    "a body name on two lines": (
        GOOD + 'body = { name = "a\\nb", mass = 1 }',
        r"body 1 has the name 'a\\nb'",
    ),
    "one of the bodies without mass": (
        GOOD + "bodies = [{ mass = 1 }, { }]",
        r"bodies\[1\]: key 'mass' is missing",
    ),
    "unknown key of bodies": (
        GOOD + "bodies = [{ mass = 1, con = [0, 0, 0] }]",
        r"bodies\[0\]: unknown key 'con'; did you mean 'com'",
    ),
    "one of the bodies negative": (
        GOOD + 'bodies = [{ mass = 1 }, { name = "load", mass = -1 }]',
        r"joint 1 \(elbow\), load: body.mass is -1 kg; expected none below 0",
    ),
    "one of the bodies impossible": (
        GOOD + "bodies = [{ mass = 1 }, { mass = 1, inertia = { xx = -1 } }]",
        r"joint 1 \(elbow\), body 2: body.inertia has the eigenvalue -1 kg m",
    ),
    "one of the bodies in an unknown length": (
        GOOD + 'bodies = [{ mass = 1 }, { mass = 1, com = ["l9", 0, 0] }]',
        r"joint 1 \(elbow\), body 2: body.com\[0\]: unknown name 'l9'",
    ),
    "limits reversed": (GOOD + "limits = [1, -1]", r"limits \[1, -1\] are the wrong way round"),
    "one limit": (GOOD + "limits = [1]", "limits: found 1 entries"),
    "negative velocity": (GOOD + "velocity = -1", "velocity is -1; expected a positive"),
    "zero effort": (GOOD + "effort = 0", "effort is 0; expected a positive"),
    "gear zero": (GOOD + "drive = { gear = 0 }", "drive.gear is 0"),
    "negative rotor": (GOOD + "drive = { rotor_inertia = -1 }", "drive.rotor_inertia is -1"),
    "coupling of one joint": (
        GOOD + "[[coupling]]\njoints = [1]\ninertia = 1",
        r"coupling\[0\].joints: found 1 entries",
    ),
    "coupling of no joint": (
        GOOD + "[[coupling]]\njoints = [1, 2]\ninertia = 1",
        r"coupling\[0\]: joints \[1, 2\]; expected two joints of 1 to 1",
    ),
    "coupling of a joint with itself": (
        GOOD + "[[coupling]]\njoints = [1, 1]\ninertia = 1",
        r"coupling\[0\]: joints \[1, 1\]; expected two joints",
    ),
    "coupling by name": (
        GOOD + "[[coupling]]\njoints = ['elbow', 1]\ninertia = 1",
        r"coupling\[0\].joints\[0\]: found 'elbow'; expected .*integer",
    ),
    "coupling without inertia": (
        GOOD + "[[coupling]]\njoints = [1, 2]",
        r"coupling\[0\]: key 'inertia' is missing",
    ),
    "coupling with an unknown name": (
        GOOD + "[[coupling]]\njoints = [1, 2]\ninertia = 'J'",
        r"coupling\[0\].inertia: unknown name 'J'",
    ),
    "coupling twice": (
        changed("elbow", "wrist")
        + changed("elbow", "elbow", JOINT)
        + "[[coupling]]\njoints = [1, 2]\ninertia = 1\n[[coupling]]\njoints = [2, 1]\ninertia = 1",
        r"coupling\[1\]: joints 1 and 2 have a coupling already",
    ),
    "coulomb signs": (GOOD + "drive = { coulomb = [-1, 1] }", r"drive.coulomb is \[-1, 1\]"),
    "unknown unit": (
        changed("format = 1", "format = 1\nunits = { length = 'ft' }"),
        "units.length: found 'ft'; expected",
    ),
    "unknown type": (
        changed("revolute", "spherical"),
        "type: found 'spherical'; expected 'revolute' or 'prismatic'",
    ),
    "unknown convention": (changed("standard", "craig"), "convention: found 'craig'"),
    "undefined parameter": (
        changed("a = 0.5", 'a = "l1"'),
        r"joint 1 \(elbow\): a: unknown name 'l1'",
    ),
    "undefined in parameters": (
        GOOD + '[parameters]\nl1 = "2*l2"',
        "parameters.l1: unknown name 'l2'",
    ),
    "parameter cycle": (
        GOOD + '[parameters]\nl1 = "l2"\nl2 = "l3"\nl3 = "l1"',
        "l1 -> l2 -> l3 -> l1 is a cycle",
    ),
    "parameter is itself": (GOOD + '[parameters]\nl1 = "l1"', "l1 -> l1 is a cycle"),
    "parameter named pi": (GOOD + "[parameters]\npi = 3", "'pi' is taken"),
    "parameter with a hyphen": (GOOD + "[parameters]\n'l-1' = 3", "'l-1' is not a name"),
    "division by a zero parameter": (
        changed("a = 0.5", 'a = "1/l1"') + "[parameters]\nl1 = 0",
        "a: division by zero",
    ),
    "import": (
        changed("a = 0.5", "a = \"__import__('os').system('touch pwned')\""),
        "unexpected character",
    ),
    "tower of powers": (changed("a = 0.5", 'a = "10**10**10"'), "a: "),
    "10,000 brackets": (changed("a = 0.5", f'a = "{"(" * 10_000}1{")" * 10_000}"'), "characters"),
    "4,000 brackets": (
        changed("a = 0.5", f'a = "{"(" * 4_000}1{")" * 4_000}"'),
        "nested more than",
    ),
    "a thousand expansions": (
        HEAD
        + "[parameters]\n"
        + "\n".join(f'p{i} = "(p{i + 1}+p{i + 2}+1)^9"' for i in range(150))
        + "\np150 = 1\np151 = 1\n"
        + JOINT,
        "too many terms|too long|more than",
    ),
    "deeply nested TOML": (
        GOOD + "limits = " + "[" * 5000 + "]" * 5000,
        "nested too deep|not TOML",
    ),
    "deeply nested tables": (
        GOOD + "body = " + "{a=" * 3000 + "1" + "}" * 3000,
        "nested too deep|not TOML",
    ),
    "deeply dotted keys": (GOOD + "a" + ".a" * 50_000 + " = 1", "nested too deep"),
    "not TOML": ("<robot/>", "not TOML"),
    "duplicate key": (GOOD + "a = 2", "not TOML"),
    "empty": ("", "key 'format' is missing"),
    "mesh outside the folder": (
        GOOD + 'shape = { mesh = "../../etc/passwd" }',
        "mesh is '../../etc/passwd'",
    ),
    "absolute mesh": (GOOD + 'shape = { mesh = "/etc/passwd" }', "expected a relative path"),
    "mesh by URL": (GOOD + 'shape = { mesh = "file:///etc/passwd" }', "expected a relative path"),
    "mesh by backslash": (GOOD + "shape = { mesh = '..\\..\\x.stl' }", "expected a relative path"),
    "two geometries": (GOOD + 'shape = { mesh = "a.stl", box = [1, 1, 1] }', "exactly one of"),
    "a mesh of scale 0": (GOOD + 'shape = { mesh = "a.stl", scale = 0 }', r"scale\[0\] is 0"),
    "a mesh of two scales": (
        GOOD + 'shape = { mesh = "a.stl", scale = [1, 2] }',
        "expected at least 3",
    ),
    "a mesh of infinite scale": (
        GOOD + 'shape = { mesh = "a.stl", scale = [1, "1/0", 1] }',
        "scale",
    ),
    "no geometry": (GOOD + 'shape = { color = "#ffffff" }', "exactly one of"),
    "negative box": (GOOD + "shape = { box = [1, -1, 1] }", r"shape.box\[1\] is -1"),
    "bad color": (
        GOOD + 'shape = { box = [1, 1, 1], color = "red" }',
        "color is 'red'; expected '#rrggbb'",
    ),
    "zero joints": (HEAD + "joint = []", "joint: found 0 entries; expected at least 1"),
    "no joints": (HEAD, "key 'joint' is missing"),
    "200 joints": (
        HEAD + JOINT.replace('name = "elbow"\n', "") * 200,
        "joint: found 200 entries; expected at most 32",
    ),
    "joint is a table": (HEAD + "joint = { a = 1 }", "joint"),
    "unknown format": (changed("format = 1", "format = 2"), "format: found 2; expected 1"),
    "format as text": (changed("format = 1", 'format = "1"'), "format: found '1'; expected 1"),
    "same name twice": (GOOD + JOINT, "joint 2: name 'elbow' is another joint's already"),
    "reserved name": (changed("elbow", "link1"), "'link1' is taken"),
    "name with a slash": (changed('"bad"', '"../bad"'), "name: found '../bad'"),
    "configuration too short": (
        GOOD + "[configurations]\nready = []",
        "configurations.ready: 0 numbers; expected 1",
    ),
    "configuration of text": (
        GOOD + '[configurations]\nready = ["q"]',
        r"configurations.ready\[0\]: unknown name 'q'",
    ),
    "assumed what": (GOOD + 'assumed = ["everything"]', r"assumed\[0\]: found 'everything'"),
    "control characters": (
        changed("format = 1", 'format = 1\nnotes = "a\\u001b]0;b"'),
        "notes: holds the control character",
    ),
    "control characters in the source": (
        changed("format = 1", 'format = 1\nsource = "a\\u0001b"'),
        "source: holds",
    ),
    "a mesh of another format": (
        GOOD + 'shape = { mesh = "two.toml" }',
        "expected one of .stl, .obj, .dae, .ply",
    ),
    "a mistyped key": (changed("alpha", "aplha"), "unknown key 'aplha'; did you mean 'alpha'"),
    "joints": (changed("[[joint]]", "[[joints]]"), "unknown key 'joints'; did you mean 'joint'"),
    "a long hexadecimal": (
        changed("a = 0.5", "a = 0x" + "f" * 4000),
        "beyond the range of a double",
    ),
    "too many parameters": (
        GOOD + "[parameters]\n" + "\n".join(f"p{i} = 1" for i in range(300)),
        "found 300 entries",
    ),
    "a long word": (GOOD + "# " + "a" * 900_000 + "\nb = 1", "unknown key 'b'"),
    "functions of functions": (
        HEAD
        + "[parameters]\np0 = 1\n"
        + "\n".join(f'p{i} = "sin(p{i - 1})+cos(p{i - 1})"' for i in range(1, 30))
        + JOINT,
        "a function of more than",
    ),
    "gravity of two": (
        changed("format = 1", "format = 1\ngravity = [0, 0]"),
        "gravity: found 2 entries",
    ),
}

BAD_BYTES = {
    "binary": (bytes(range(256)) * 10, "not UTF-8 text"),
    "wrong encoding": (GOOD.replace("bad", "bäd").encode("utf-16"), "not UTF-8 text"),
    "latin-1": (GOOD.replace("bad", "bäd").encode("latin-1"), "not UTF-8 text"),
    "null bytes": (b"\0" * 100, "not TOML"),
}
