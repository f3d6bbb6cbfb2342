// Requests to Python. Of those that a drag repeats one is under way, and behind it waits only the latest (of each joint), so
// that nothing queues; others, such as steps and edits, are all sent, and answered in order.

const REPEATED = new Set([
  "joints.set",
  "dynamics.read",
  "workspace.read",
  "tool.read",
  "tool.target",
  "motion.show",
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
      const busy =
        REPEATED.has(name) && [...this.open.values()].some((other) => other.name === name);
      if (!busy) return this.send(request);
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
