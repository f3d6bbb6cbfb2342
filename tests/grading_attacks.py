r"""Hostile answers as data: entries, sheets, programs, robot files and objects that no student means well with.

``CANARY`` is what they try to create, ``SECRET`` what they try to read; neither may ever happen.
"""

import json
import os
import tempfile
from pathlib import Path

import sympy

CANARY = Path(tempfile.gettempdir()) / f"dhkit-canary-{os.getpid()}"
SECRET = Path(tempfile.gettempdir()) / f"dhkit-secret-{os.getpid()}.toml"
TOUCH = f"touch {CANARY}"
LONG = 190_000  # characters: as many as an entry may have
NINE = "(m1 + m2 + l1 + l2 + g + cos(q1) + sin(q1) + cos(q2) + sin(q2))"
RIGHT_V = "m1*g*l1/2*sin(q1) + m2*g*(l1*sin(q1) + l2/2*sin(q1 + q2))"

# What is not an answer, as the potential energy of planar2r.

REFUSED = {
    "import": f"__import__('os').system('{TOUCH}')",
    "import without quotes": "__import__(os)",
    "open": f"open('{CANARY}', 'w')",
    "eval": f'eval(\'__import__("os").system("{TOUCH}")\')',
    "exec": f'exec(\'open("{CANARY}", "w")\')',
    "attribute chain": "().__class__.__bases__[0].__subclasses__()",
    "attribute of a module": f"np.os.system('{TOUCH}')",
    "attribute of a number": "(1).__class__",
    "attribute of a function": "sin.__globals__",
    "attribute of a name": "m1.__init__.__globals__",
    "lambda": "(lambda: m1)()",
    "f-string": f"f\"{{__import__('os').system('{TOUCH}')}}\"",
    "walrus": "(x := 1)",
    "comprehension": "[m1 for m1 in range(10**9)]",
    "semicolon": f"m1; import os; os.system('{TOUCH}')",
    "newline": f"m1\nimport os\nos.system('{TOUCH}')",
    "sympify": "sympify('__import__(\"os\")')",
    "MATLAB's system": f"system('{TOUCH}')",
    "MATLAB's shell": f"!{TOUCH}",
    "shell": f"$({TOUCH})",
    "format": "{0.__class__}",
    "markup": "[link=file:///etc/passwd]m1[/link]",
    "script": "<script>alert(1)</script>",
    "formula": "=cmd|'/c calc'!A1",
    "tower of powers": "9**9**9",
    "large power": "(m1+m2)**10000",
    "power of nine": f"{NINE}^60",
    "negative power": "(m1+m2)**-10000",
    "a million brackets": lambda: "(" * 1_000_000 + "m1" + ")" * 1_000_000,
    "brackets": "(" * 90_000 + "m1" + ")" * 90_000,
    "open brackets": "(" * LONG,
    "closing brackets": ")" * LONG,
    "square brackets": "[" * 90_000 + "m1" + "]" * 90_000,
    "closing braces": "}" * LONG,
    "a long line": lambda: "m1+" * 16_000_000 + "m1",
    "a long name": "a" * LONG,
    "a long name of numbers": "q" + "1" * LONG,
    "a long name of names": "m1l2" * (LONG // 4),
    "a long sum of angles": "c" + "1" * LONG,
    "many decimals": "0." + "1" * 10_000,
    "large exponent": "1e300000",
    "division by zero": "1/0",
    "division by zero that is hidden": "m1/(sin(q1)^2 + cos(q1)^2 - 1)",
    "division by zero of zero": "0/0",
    "zero to the minus one": "0^-1",
    "cosine of many": "cos(64*q1)*cos(63*q2)**64",
    "cosine of too many": "cos(65*q1)",
    "factorial": "99999999!",
    "infinity": "inf",
    "not a number": "nan",
    "functions in a row": "sin " * 40_000 + "q1",
    "function of nothing": "sin()",
    "derivatives": "diff(" * 49 + "q1" + ", t)" * 49,
    "NUL": "m1\0*l1",
    "escape": "m1\x1b[2J\x1b]0;pwned\x07",
    "direction": "m1*\u202e2l",
    "Cyrillic": "m1*\u0441os(q1)",
    "full width": "\uff4d1",
    "zero width": "m\u200b1",
    "combining": "m1" + "\u0301" * 10_000,
    "surrogate": "m1*\ud800",
    "superscripts": "9⁹⁹⁹⁹⁹⁹",
    "LaTeX input": r"\input{/etc/passwd}",
    "LaTeX write": rf"\immediate\write18{{{TOUCH}}}",
    "LaTeX catcode": r"\catcode`\@=11",
    "LaTeX csname": r"\csname input\endcsname{/etc/passwd}",
    "LaTeX macro": r"\def\a{\a\a}\a",
    "LaTeX link": r"\href{javascript:alert(1)}{m_1}",
    "LaTeX fractions": r"\frac" * 30_000,
    "LaTeX depth": r"\frac{" * 30_000,
    "LaTeX braces": "{" * 90_000 + "m_1" + "}" * 90_000,
    "LaTeX dots": r"\dot" * 40_000 + "q_1",
    "LaTeX left": r"\left" * 30_000,
    "LaTeX letters": r"\frac{1}{2}" + "a" * 2_000,
    "LaTeX many letters": r"\frac{1}{2}" + "ab" * (LONG // 3),
    "LaTeX point": r"\frac{1}{2} m_1^.",
    "LaTeX subscripts": "m_{" * 40_000 + "1" + "}" * 40_000,
    "LaTeX environment": r"\begin{verbatim}m1\end{verbatim}",
    "LaTeX matrices": r"\begin{matrix}" * 10_000,
}

# What can be read, but takes long, or has no value, or has too many digits.

WRONG = {
    "template": "{{7*7}}",
    "tower of powers of no exponent": "2^(9^(9^9))",
    "terms": f"{NINE}^6",
    "powers of powers": "((((m1+l1)^4)^4)^4)",
    "products": "*".join([NINE] * 12),
    "cosine of both": "cos(64*q1 + 64*q2)",
    "thousand denominators": " + ".join(f"1/(m1 + {k}*l1)" for k in range(1, 1001)),
    "tower of quotients": "1/(l1+" * 45 + "m1" + ")" * 45,
    "tower of quotients of angles": "1/(cos(q1)+m1/(sin(q2)+l1*" * 20 + "m2" + "))" * 20,
    "division": f"{NINE}^6/(m1 - l1 + m2 - cos(q2))^5",
    "hundreds of decimals": " + ".join(f"{1 + k / 7:.5f}*m1" for k in range(500)),
    "thousands of decimals": " + ".join(
        f"{1 + k / 7:.5f}*m1^{k % 60}*l1^{k // 60}" for k in range(3_000)
    ),
    "decimals in products": "*".join(
        f"({1 + k / 7:.5f}*m1 + {2 + k / 7:.5f}*l1)" for k in range(150)
    ),
    "long fractions": " + ".join(f"1/{10**39 + k}" for k in range(4_000)),
    "longer fractions": " + ".join(f"1/{10**300 + k}" for k in range(500)),
    "powers of fractions": "(1/3 + 1e-300)^64*" * 50 + "1",
    "many terms": "+".join(["m1"] * 60_000),
    "signs": "-" * LONG + "m1",
    "primes": "m1" + "'" * LONG,
    "cosine of a product": "cos(" + "*".join(["(m1+l1+q1+q2+m2+l2)"] * 40) + ")",
    "roots": "sqrt(" * 45 + "m1 + l1" + ")" * 45,
    "many roots": " + ".join(f"sqrt(q1^2 + {k})" for k in range(9_000)),
    "exponentials": "exp(exp(exp(1e9)))",
    "exponentials in numbers": "exp(exp(exp(20)))",
    "sine of a large number": "sin(1e300)",
    "sine of an exponential": "sin(exp(exp(20)))",
    "names to the names": "g^g^g^g",
    "half powers": "(q1^(1/2))^(64 + 1/2)",
    "large half powers": "2^(2^(2^(2^(2^0.5))))",
    "large powers of names": "m1^(1e300*l1)",
    "power of no whole number": "m1^(" + "*".join(["1.00001^64"] * 300) + ")",
    "root of a negative number": "sqrt(-m1)",
    "power of a negative number": "(m1 - 3*m1)^l1",
    "power of zero": "(q1 - q1)^(-l1)",
    "logarithm by arc cosine": "acos(1e300)",
    "arc tangent of zeros": "atan2(0, 0)",
    "large product": "m1*1e308*1e308",
    "small product": "m1*1e-308*1e-308",
    "minimum of roots": "min(sqrt(-1), 2)",
    "sign of a root": "sign(sqrt(-1))",
}

# What is right, but cannot be proved, and takes long to try.
SLOW = {
    "half angles": f"{RIGHT_V} + 0*(" + " + ".join(f"sin(q1/{k + 2})" for k in range(10_000)) + ")",
    "half angles of few": f"{RIGHT_V} + 0*("
    + " + ".join(f"sin(q1/{k + 2})" for k in range(50))
    + ")",
}


def made(value):
    """Return what an attack is: the long ones are made when they are needed."""
    return value() if callable(value) else value


def quoted(text):
    """Return text as a basic string of TOML; a half of a character, which TOML cannot have, as a question mark."""
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=False).replace(
        "\x7f", "\\u007f"
    )


def sheet(answer, robot="planar2r", more=""):
    return f"format = 1\nrobot = {quoted(robot)}\n{more}\n[answer]\n{answer}\n"


# Sheets.

DEEP = "a" + ".a" * 3_000
NAMES_FLOOD = '[names.parameters]\na = "' + "+".join(["m1"] * 9_000) + '"\n'

SHEETS = {
    "nothing": "",
    "no TOML": "import os\nos.system('touch x')",
    "no answers": 'format = 1\nrobot = "planar2r"\n',
    "no text": b"\xff\xfe\x00",
    "NUL": b"format = 1\x00",
    "50 MB": lambda: b"#" * 50_000_000,
    "4 MB": b"# " * 1_999_000,
    "deep arrays": sheet("V = " + "[" * 100_000 + "]" * 100_000),
    "arrays": sheet("V = " + "[" * 300 + "'m1'" + "]" * 300),
    "deep tables": sheet("V = " + "{a=" * 100_000),
    "dotted key": f"{DEEP} = 1",
    "long dotted key": "a" + ".a" * 1_900_000 + " = 1",
    "long dotted table": "[a" + ".a" * 1_900_000 + "]",
    "many dotted keys": "".join(f"x.{'a.' * 50}b{k} = 1\n" for k in range(20_000)),
    "deep table that is shown": f"format = [{{{DEEP} = 1}}]",
    "deep table for an answer": sheet(f"V = {{{DEEP} = 1}}"),
    "deep table in a list": sheet(f"M = [[{{{DEEP} = 1}}]]"),
    "long integer": sheet("V = " + "9" * 5_000),
    "hexadecimal integer": sheet("V = 0x" + "f" * 5_000),
    "long hexadecimal integer": sheet("V = 0x" + "f" * 3_000_000),
    "hexadecimal integer in a matrix": sheet("M = [[0x" + "f" * 5_000 + ", 1], [1, 1]]"),
    "hexadecimal name": sheet("V = 'a'", more="names.parameters.a = 0x" + "f" * 5_000),
    "hexadecimal format": "format = 0x" + "f" * 5_000,
    "hexadecimal robot": "robot = 0x" + "f" * 5_000,
    "huge exponent": sheet("V = 1e99999999999999999999999"),
    "large exponent": sheet("V = 1e999999999"),
    "not a number": sheet("V = nan"),
    "infinity": sheet("M = [[inf, -inf], [inf, inf]]"),
    "a date": sheet("V = 1979-05-27T07:32:00Z"),
    "truth": sheet("V = true"),
    "unknown key": 'format = 1\n"\\u001b[31m" = 1\n',
    "long key": f'"{"k" * 3_000_000}" = 1\n',
    "many keys": "".join(f"k{k} = 1\n" for k in range(200_000)),
    "unknown quantity": sheet('"<script>alert(1)</script>" = "1"'),
    "no robot": 'format = 1\n[answer]\nV = "1"',
    "robot outside": sheet('V = "1"', f"../{SECRET.name}"),
    "robot from the root": sheet('V = "1"', str(SECRET)),
    "robot with a NUL": sheet('V = "1"', "a\0.toml"),
    "robot with dots": sheet('V = "1"', f"./x/../../{SECRET.name}"),
    "robot with a long name": sheet('V = "1"', "x" * 100_000 + ".toml"),
    "robot with a long path": sheet('V = "1"', "x/" * 100_000 + ".toml"),
    "robot with control characters": sheet('V = "1"', "\x1b[31m\n"),
    "robot file with control characters": sheet('V = "1"', "\x1b[31m\n.toml"),
    "robot that is the sheet": sheet('V = "1"', "sheet.toml"),
    "robot that is the folder": sheet('V = "1"', ".toml"),
    "robot in a device": sheet('V = "1"', "/dev/zero.toml"),
    "wrong shapes": sheet('M = [["1"], ["1", "2"]]'),
    "many entries": sheet("M = [" + "'1'," * 100_000 + "]"),
    "many spaces": sheet(f"M = '[{'1 ' * 90_000}]'"),
    "many semicolons": sheet(f"M = '{';' * LONG}'"),
    "brackets around a matrix": sheet(f"M = '{'(' * 90_000}{')' * 90_000}'"),
    "transposes of a matrix": sheet(f'M = "[1]{chr(39) * LONG}"'),
    "rows of rows": sheet(f"M = '[{'[1],' * 40_000}]'"),
    "names that are none": sheet(
        'V = "1"', more=f"[names]\nq = [{quoted('k' * 100_000 + '-')}, 'b']"
    ),
    "a name for two things": sheet(
        'V = "1"', more=f"[names]\nq = [{quoted('k' * 100_000)}, {quoted('k' * 100_000)}]"
    ),
    "a name with control characters": sheet(
        'V = "1"', more=f"names.parameters.{quoted(chr(27) + '[2J' + chr(10))} = 'x'"
    ),
    "a name of a million": sheet('V = "zz"', more=f'names.parameters.{"k" * 1_000_000} = "m1"'),
    "names of themselves": sheet("V = 'a'", more="[names.parameters]\na = 'b'\nb = 'a'"),
    "names that double": sheet(
        "V = 'a40'",
        more="[names.parameters]\na0 = '1+1'\n"
        + "".join(f"a{k + 1} = 'a{k}+a{k}*a{k}'\n" for k in range(40)),
    ),
    "names that flood an entry": sheet(f"V = '{'+'.join(['a'] * 95_000)}'", more=NAMES_FLOOD),
    "names that flood a name": sheet(
        "V = 'b'", more=NAMES_FLOOD + f"b = '{'+'.join(['a'] * 95_000)}'"
    ),
    "names in powers": sheet(
        "V = 'a9'",
        more="[names.parameters]\na0 = 'm1+l1'\n"
        + "".join(f"a{k + 1} = 'a{k}^8'\n" for k in range(9)),
    ),
    "too many names": sheet(
        "V = '1'", more="[names.parameters]\n" + "".join(f"a{k} = '1'\n" for k in range(1_000))
    ),
    "table of no rows": sheet("dh.rows = []"),
    "table of texts": sheet("dh.rows = ['q1', 'q2']"),
    "table of powers": sheet("dh.rows = [['q1', '0', 'g^g^g', '0'], ['q2', '0', 'l2', '0']]"),
    "table of no number": sheet(
        "dh.rows = [['q1', '0', '(l1-3*l1)^l2', '0'], ['q2', '0', 'l2', '0']]"
    ),
    "table of a power of zero": sheet(
        "dh.rows = [['q1', '0', '(l1-l1)^(-l2)', '0'], ['q2', '0', 'l2', '0']]"
    ),
    "table of infinities": sheet(
        "dh.rows = [['1/0', '0/0', 'exp(exp(9999))', 'sqrt(-1)'], ['q2', '0', 'l2', '0']]"
    ),
    "table of large numbers": sheet(
        "dh.rows = [['q1*1e300', '1e300', '1e308', '1e300'], ['q2', '0', 'l2', '0']]"
    ),
    "table of long sums": sheet(
        f"dh.rows = [['q1', '0', '{'+'.join(['l1'] * 30_000)}', '0'], ['q2', '0', 'l2', '0']]"
    ),
    "no branches": sheet("ik.branches = []"),
    "too many branches": sheet("ik.branches = [" + "['1', '1']," * 65 + "]"),
    "many branches": sheet(
        "ik.branches = [" + "['atan2(py,px)+acos(px)', 'sqrt(px^2+py^2)']," * 64 + "]"
    ),
    "branch of powers": sheet("ik.branches = [['g^g^g', '1']]"),
    "branch of no number": sheet("ik.branches = [['(l1-3*l1)^l2', '1']]"),
    "branch of an angle of no number": sheet("ik.branches = [['atan2((l1-3*l1)^l2, 1)', '1']]"),
    "branch of a power of zero": sheet("ik.branches = [['(l1-l1)^(-l2)', '1']]"),
    "branch of large powers": sheet("ik.branches = [['exp(exp(exp(1e9)))', 'px^1e300']]"),
    "branch of nothing": sheet("ik.branches = [['0/0', '1/0']]"),
    "branch of roots": sheet(f"ik.branches = [['{'+'.join(['sqrt(px^2)'] * 9_000)}', 'q1']]"),
    "branch of arcs": sheet(
        f"ik.branches = [['{'+'.join(['acos(py/px)'] * 9_000)}', '{'+'.join(['atan(py/px)'] * 9_000)}']]"
    ),
    "branches that need each other": sheet("ik.branches = [['q2', 'q1']]"),
    "code in a branch": sheet("ik.branches = [[\"__import__('os').abort()\", '1']]"),
    "every entry long": sheet(
        "".join(f'{name} = [["{NINE}^6", "{NINE}^6"], ["{NINE}^6", "{NINE}^6"]]\n' for name in "MC")
    ),
    "right and hostile": sheet(f"V = {quoted(RIGHT_V)}\nK = \"__import__('os').abort()\""),
}

ADDED = {
    "rubric": sheet(
        'V = "1"', more='[rubric]\npoints = "__import__(1)"\n[rubric.weights]\nV = "inf"'
    ),
    "student": sheet('V = "1"', more='student = "\\u001b[2J\\n../../etc/passwd\\u0000<script>"'),
    "names of functions": sheet("V = 'sin(q1)'", more="[names]\nq = ['sin', 'cos']"),
    "names of pi": sheet("V = 'pi'", more="[names.parameters]\npi = '3'\nm1 = 'l1'"),
    "empty name": sheet("V = '1'", more='names.parameters."" = "m1"'),
}
"""Sheets that are judged, whatever else they have."""

# Programs and papers.

SOURCES = {
    "Python": (".py", f"import os\nos.system('{TOUCH}')\nV = __import__('os').system('{TOUCH}')\n"),
    "Python's brackets": (".py", "(" * 900_000 + "\nV = 1"),
    "Python's lines in a bracket": (".py", "(\n" + "\n" * 990_000),
    "Python's semicolons": (".py", ";" * 990_000),
    "Python's semicolons in a bracket": (".py", "(" + ";" * 990_000),
    "Python's assignments": (".py", "V = 1\n" * 100_000),
    "Python's names": (
        ".py",
        "".join(f"{'x' * 60}{k} = m1 + {'x' * 60}{k}\n" for k in range(4_000)) + "V = m1",
    ),
    "Python's doubling": (
        ".py",
        "a0 = m1+1\n" + "".join(f"a{k + 1} = a{k}*a{k}+a{k}\n" for k in range(90)) + "V = a90",
    ),
    "Python's class": (".py", f"class V:\n  def __init__(self): open('{CANARY}', 'w')\nV = V()"),
    "Python's exec": (".py", f"V = exec(open('{SECRET}').read())"),
    "MATLAB": (".m", f"!{TOUCH}\nsystem('{TOUCH}');\nV = eval('system(''{TOUCH}'')');"),
    "MATLAB's lines in a bracket": (".m", "(\n" + "\n" * 900_000),
    "MATLAB's dots": (".m", "...\n" * 240_000),
    "MATLAB's index": (".m", "h(99999999999999999999) = 1\nM(0,0) = 2\nV = 1"),
    "MATLAB's energy with indices": (".m", "K(1,1)=1\nK(1,2)=2\nK(2,1)=3;K(2,2)=4"),
    "MATLAB's primes": (".m", "V = m1" + "'" * 990_000),
    "Python's length": (".py", "V = m1\n" + "#" * 3_900_000),
    "LaTeX": (
        ".tex",
        f"\\input{{{SECRET}}}\n\\immediate\\write18{{{TOUCH}}}\n\\[ V = \\input{{{SECRET}}} \\]",
    ),
    "LaTeX's macros": (
        ".tex",
        "".join(f"\\def\\{chr(97 + k)}{{\\{chr(98 + k) * 2}}}\n" for k in range(24))
        + "\\[V=\\a\\]",
    ),
    "LaTeX's matrices": (".tex", "\\begin{bmatrix}" * 60_000),
    "LaTeX's rows": (".tex", "\\begin{bmatrix}" + "\\\\" * 490_000),
    "LaTeX's dollars": (".tex", "$" * 990_000),
    "LaTeX's lines": (".tex", "\n \n x" * 190_000),
    "LaTeX's brackets": (".tex", "V" + "(" * 990_000 + "= 1"),
    "LaTeX's comments": (".tex", "\\%" * 440_000 + "\n" + "%" * 100_000),
    "notebook": (
        ".ipynb",
        json.dumps(
            {
                "cells": [
                    {
                        "cell_type": "code",
                        "source": f"!{TOUCH}\nV = get_ipython().system('{TOUCH}')",
                    }
                ]
            }
        ),
    ),
    "notebook that is deep": (".ipynb", "[" * 3_000_000),
    "notebook with long numbers": (".ipynb", '{"cells": ' + "9" * 5_000 + "}"),
    "notebook of no cells": (".ipynb", '{"cells": "abc"}'),
    "notebook of numbers": (".ipynb", '{"cells": [{"cell_type": "code", "source": [1, null]}]}'),
    "notebook of no language": (".ipynb", '{"cells": [], "metadata": {"kernelspec": []}}'),
    "notebook with half a character": (
        ".ipynb",
        json.dumps({"cells": [{"cell_type": "code", "source": "V = \ud800*m1"}]}),
    ),
    "notebook with half a name": (
        ".ipynb",
        json.dumps({"cells": [{"cell_type": "code", "source": "\ud800 = 3\nV = m1"}]}),
    ),
    "NUL": (".py", "V = m1\0"),
    "UTF-16": (".py", "V = m1".encode("utf-16")),
    "no UTF-8": (".py", b"V = m1 \xff"),
    "50 MB": (".py", lambda: b"V = m1 +" * 6_000_000),
    "nothing": (".tex", ""),
}

# Robots in the sheet's own folder.

ONE = '[[joint]]\ntype = "revolute"\na = {a}\nd = 0\nalpha = 0\ntheta = 0\n'
A1 = 'A1 = [["1", "0", "0", "0"], ["0", "1", "0", "0"], ["0", "0", "1", "0"], ["0", "0", "0", "1"]]'


def robot(joints, parameters="", name="hostile"):
    return f'format = 1\nname = {quoted(name)}\nconvention = "standard"\n[parameters]\n{parameters}\n{joints}'


def symbolic(n):
    """A robot of which everything is a parameter."""
    letters = ("a", "d", "t", "m", "c", "iz")
    parameters = "".join(f"{letter}{i} = 1.0\n" for i in range(1, n + 1) for letter in letters)
    return robot(
        "".join(
            f'[[joint]]\ntype = "revolute"\na = "a{i}"\nd = "d{i}"\nalpha = "t{i}"\ntheta = 0\n'
            f'body = {{ mass = "m{i}", '
            f'com = ["c{i}", "c{i}", "c{i}"], inertia = {{ xx = "iz{i}", yy = "iz{i}", zz = "iz{i}" }} }}\n'
            for i in range(1, n + 1)
        ),
        parameters,
    )


ROBOTS = {
    "nothing": ("", A1),
    "no TOML": ("import os", A1),
    "33 joints": (symbolic(33), 'V = "1"'),
    "a mesh outside": (
        robot(
            ONE.format(a=1).replace(
                "theta = 0", f'theta = 0\nshape = {{ mesh = "../{SECRET.name}" }}'
            )
        ),
        A1,
    ),
    "a mesh from the root": (
        robot(ONE.format(a=1).replace("theta = 0", f'theta = 0\nshape = {{ mesh = "{SECRET}" }}')),
        A1,
    ),
    "code in a parameter": (robot(ONE.format(a='"a"'), "a = \"__import__('os').abort()\""), A1),
    "code in a joint": (robot(ONE.format(a="\"__import__('os').abort()\"")), A1),
    "a tower of powers": (robot(ONE.format(a='"a"'), 'a = "9^9^9"'), A1),
    "parameters that double": (
        robot(
            ONE.format(a='"a59"'),
            'a0 = "1+pi"\n' + "".join(f'a{k + 1} = "a{k}*a{k}+a{k}"\n' for k in range(59)),
        ),
        A1,
    ),
    "parameters of themselves": (robot(ONE.format(a='"a"'), 'a = "b"\nb = "a"'), A1),
    "powers of parameters": (robot(ONE.format(a='"(a+b)^60"'), "a = 1.0\nb = 2.0"), A1),
    "deep keys": ("a" + ".a" * 300_000 + " = 1", A1),
    "long numbers": (robot(ONE.format(a='"a"'), "a = 0x" + "f" * 5_000), A1),
    "huge exponents": (robot(ONE.format(a='"a"'), "a = 1e99999999999999999999999"), A1),
    "names of tags": (
        robot(ONE.format(a=1), '"<b>" = 1.0', "\x1b[31m<script>alert(1)</script>"),
        A1,
    ),
    "names of joints": (robot(ONE.format(a='"q1"'), "q1 = 1.0"), A1),
    "not a number": (robot(ONE.format(a="nan")), A1),
    "more than 1 MB": (robot(ONE.format(a=1), "# " * 600_000), A1),
}

ENDLESS = {
    "32 joints' energy": (symbolic(32), 'V = "1"'),
    "32 joints' transform": (
        symbolic(32),
        "T = [['1', '0', '0', '0'], ['0', '1', '0', '0'], ['0', '0', '1', '0'], ['0', '0', '0', '1']]",
    ),
    "6 joints' torques": (symbolic(6), 'tau = ["1", "1", "1", "1", "1", "1"]'),
    "6 joints' inverse": (symbolic(6), "ik.branches = [['px', 'py', 'pz', 'r11', 'r12', 'r13']]"),
}
"""Robots that take longer than any student's: the limits of a sheet's process are there for them."""

# Objects of the Python API.


def casadi_chain(times, step):
    import casadi

    x = casadi.SX.sym("q", 2)[0]
    for _ in range(times):
        x = step(casadi, x, casadi.SX.sym("m1"))
    return x


def sympy_chain(times, step):
    x = sympy.Symbol("q1")
    for _ in range(times):
        x = step(x)
    return x


def itself():
    found = []
    found.append(found)
    return found


OBJECTS = {
    "CasADi's long chain": lambda: casadi_chain(3_000, lambda ca, x, m: ca.sin(x) + m),
    "CasADi's long sum": lambda: casadi_chain(3_000, lambda ca, x, m: x + ca.sin(x)),
    "CasADi's endless chain": lambda: casadi_chain(50_000, lambda ca, x, m: ca.sin(x) + m),
    "CasADi's shared squares": lambda: casadi_chain(60, lambda ca, x, m: x * x + m),
    "CasADi's shared sines": lambda: casadi_chain(
        60, lambda ca, x, m: ca.cos(x) * ca.sin(x * x) + x
    ),
    "CasADi's names": lambda: casadi_chain(
        1, lambda ca, x, m: ca.SX.sym("__import__('os').abort()")
    ),
    "CasADi's infinity": lambda: casadi_chain(1, lambda ca, x, m: m * ca.SX(float("inf"))),
    "CasADi's error function": lambda: casadi_chain(1, lambda ca, x, m: ca.erf(m)),
    "CasADi's condition": lambda: casadi_chain(1, lambda ca, x, m: ca.if_else(m > 0, m, 2)),
    "sympy's shared sines": lambda: sympy_chain(
        30, lambda x: sympy.sin(x, evaluate=False) + sympy.cos(x, evaluate=False)
    ),
    "sympy's depth": lambda: sympy_chain(300, lambda x: sympy.cos(x, evaluate=False)),
    "sympy's own function": lambda: sympy.Function("f")(sympy.Symbol("q1")),
    "sympy's infinity": lambda: sympy.zoo,
    "sympy's imaginary unit": lambda: sympy.I * sympy.Symbol("q1"),
    "sympy's long number": lambda: sympy.Integer(10) ** 10**5,
    "sympy's integral": lambda: sympy.Integral(sympy.Symbol("q1"), sympy.Symbol("q1")),
    "a long integer": lambda: 10**5000,
    "not a number": lambda: float("nan"),
    "a complex number": lambda: 1j,
    "a list of itself": itself,
    "bytes": lambda: b"m1",
    "a set": lambda: {1},
    "a function of nothing": lambda: lambda: 1,
    "a function that fails": lambda: lambda q: 1 / 0,
    "a function of complex numbers": lambda: lambda q: 1j,
}
