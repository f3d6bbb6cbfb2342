// Requests to Python. Of those that a drag repeats a bounded number is under way, and behind them waits only the latest (of
// each joint), so that nothing queues; others, such as steps and edits, are all sent, and answered in order.

// How many may be under way. Two for a dragged target: Python computes one while the page draws the answer to the other.
const UNDER_WAY = new Map([
  ["joints.set", 1],
  ["dynamics.read", 1],
  ["workspace.read", 1],
  ["tool.read", 1],
  ["tool.target", 2],
  ["motion.show", 1],
]);

export class Requests {
  constructor(connection, failed) {
    this.connection = connection;
    this.failed = failed;
    this.count = 0;
    this.open = new Map(); // by number
    this.waiting = new Map(); // by name and joint
  }

  // A promise of the answer's data; a request that a later one has replaced gives null.
  ask(name, data = {}) {
    return new Promise((resolve) => {
      const request = { name, data, resolve },
        key = `${name} ${data.joint ?? ""}`;
      const same = [...this.open.values()].filter((other) => other.name === name);
      const bound = UNDER_WAY.get(name) ?? Infinity;
      if (same.length < bound) return this.send(request);
      this.waiting.get(key)?.resolve(null);
      this.waiting.set(key, request);
    });
  }

  send(request) {
    const id = ++this.count;
    this.open.set(id, request);
    if (!this.connection.send({ type: "request", id, name: request.name, data: request.data }))
      this.take({ id, error: "not connected to Python" });
  }

  take({ id, data, error }) {
    const request = this.open.get(id);
    if (!request) return void (error && this.failed(error));
    this.open.delete(id);
    const next = [...this.waiting].find(([, { name }]) => name === request.name);
    if (next) {
      this.waiting.delete(next[0]);
      this.send(next[1]);
    }
    if (error !== undefined) this.failed(error, request.name);
    request.resolve(error === undefined ? data : null);
  }

  // The connection was lost: nobody answers what is under way.
  drop() {
    const requests = [...this.open.values(), ...this.waiting.values()];
    this.open.clear();
    this.waiting.clear();
    for (const { resolve } of requests) resolve(null);
  }
}
