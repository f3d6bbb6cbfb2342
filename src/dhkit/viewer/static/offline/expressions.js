// Numbers of a table as a person types them, such as pi/2, 90*deg or 17*inch: read by the grammar of
// dhkit/expressions/syntax.py, never evaluated as code.

const CONSTANTS = { pi: Math.PI, deg: Math.PI / 180, mm: 1e-3, cm: 1e-2, inch: 0.0254 };
const FUNCTIONS = {
  sin: (x) => quarters(x)[1],
  cos: (x) => quarters(x)[0],
  tan: tangent,
  abs: Math.abs,
  asin: Math.asin,
  acos: Math.acos,
  atan: Math.atan,
  atan2: Math.atan2,
  sqrt: Math.sqrt,
};
const TOKEN = /\s*(?:((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|(\*\*|[-+*/^(),]))/y;
const LONGEST = 10000; // characters
const DEEPEST = 50; // brackets, signs and powers in each other

const MOST_POWER = 64;

// Cosine and sine, exact at multiples of 90°.
function quarters(x) {
  const turns = Math.round((2 * x) / Math.PI),
    exact = Math.abs(x - (turns * Math.PI) / 2) <= 4e-16 * Math.abs(x);
  return exact
    ? [
        [1, 0],
        [0, 1],
        [-1, 0],
        [0, -1],
      ][((turns % 4) + 4) % 4]
    : [Math.cos(x), Math.sin(x)];
}

function tangent(x) {
  const [c, s] = quarters(x);
  return s / c;
}

// 90° is 90*deg, π is pi, a decimal comma a point, where no function takes several values.
export function normalized(text) {
  return text
    .trim()
    .replaceAll("°", "*deg")
    .replaceAll("π", "pi")
    .replaceAll("\u2212", "-")
    .replace(/(\d),(?=\d)/g, text.includes("(") ? "$&" : "$1.");
}

// The value of an expression of names with values; an Error says what is wrong.
export function value(text, names = {}) {
  const parser = new Parser(text, { ...CONSTANTS, ...names });
  const result = finite(parser.sum());
  if (parser.at < parser.tokens.length) parser.fail();
  return result;
}

function finite(x) {
  if (!Number.isFinite(x)) throw new Error("no finite value");
  return x;
}

class Parser {
  constructor(text, names) {
    if (text.length > LONGEST)
      throw new Error(`${text.length} characters; expected at most ${LONGEST}`);
    this.names = names;
    this.at = this.depth = 0;
    this.tokens = [];
    for (TOKEN.lastIndex = 0; TOKEN.lastIndex < text.trimEnd().length;) {
      const from = TOKEN.lastIndex,
        found = TOKEN.exec(text);
      if (!found)
        throw new Error(
          `found ${JSON.stringify(text.slice(from, from + 10).trim())}; expected a number or an expression`,
        );
      this.tokens.push(found[1] ? Number(found[1]) : (found[2] ?? found[3]));
    }
  }

  fail() {
    const found = this.tokens[this.at],
      before = this.tokens[this.at - 1];
    if (typeof before === "number" && /^[A-Za-z_]/.test(found))
      throw new Error(`found ${found} behind ${before}; write ${before}*${found}`);
    throw new Error(
      found === undefined
        ? "the expression ends too early"
        : `found ${found}; expected ${typeof found === "number" ? "a sign before it" : "a number or a name"}`,
    );
  }

  takes(...signs) {
    if (!signs.includes(this.tokens[this.at])) return null;
    return this.tokens[this.at++];
  }

  sum() {
    let total = this.product(),
      sign;
    while ((sign = this.takes("+", "-")))
      total = sign === "+" ? total + this.product() : total - this.product();
    return total;
  }

  product() {
    let total = this.signed(),
      sign;
    while ((sign = this.takes("*", "/")))
      total = finite(sign === "*" ? total * this.signed() : total / this.signed());
    return total;
  }

  signed() {
    if (++this.depth > DEEPEST)
      throw new Error(`more than ${DEEPEST} brackets, signs and powers in each other`);
    const sign = this.takes("+", "-"),
      result = sign ? this.signed() : this.power();
    this.depth--;
    return sign === "-" ? -result : result;
  }

  power() {
    const base = this.atom();
    if (!this.takes("^", "**")) return base;
    const exponent = this.signed();
    if (!Number.isInteger(2 * exponent) || Math.abs(exponent) > MOST_POWER)
      throw new Error(`an exponent of ${exponent}; expected a whole number or half of one`);
    return finite(base ** exponent);
  }

  atom() {
    if (this.takes("(")) return this.closed();
    const token = this.tokens[this.at++];
    if (typeof token === "number") return token;
    if (typeof token !== "string" || !/^\w/.test(token)) this.fail(this.at--);
    if (this.takes("(")) {
      const values = [this.sum()];
      while (this.takes(",")) values.push(this.sum());
      const known = Object.hasOwn(FUNCTIONS, token) ? FUNCTIONS[token] : null;
      if (!known)
        throw new Error(
          `unknown function ${token}; expected one of ${Object.keys(FUNCTIONS).join(", ")}`,
        );
      if (known.length !== values.length)
        throw new Error(
          `${token} takes ${known.length} value${known.length > 1 ? "s" : ""}, found ${values.length}`,
        );
      if (!this.takes(")")) this.fail();
      return finite(known(...values));
    }
    if (!Object.hasOwn(this.names, token))
      throw new Error(
        `unknown name ${token}; known are ${Object.keys(this.names).slice(0, 12).join(", ")}`,
      );
    return this.names[token];
  }

  closed() {
    const result = this.sum();
    if (!this.takes(")")) this.fail();
    return result;
  }
}
