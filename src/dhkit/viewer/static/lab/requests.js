// Requests to Python. Of those that a drag repeats one is under way, and behind it waits only the latest wish, so that
// nothing queues; others, such as steps and edits, are all sent, and answered in order.

const REPEATED = new Set(["joints.set", "tool.target", "motion.show"]);

export class Requests {
  constructor(connection, failed) {
    this.connection = connection;
    this.failed = failed;
    this.count = 0;
    this.open = new Map(); // by number
    this.waiting = new Map(); // by name
  }

  // A promise of the answer's data; a wish that a later one of the same name has replaced gives null.
  ask(name, data = {}) {
    return new Promise((resolve) => {
      const wish = { name, data, resolve };
      const busy = REPEATED.has(name) && [...this.open.values()].some((other) => other.name === name);
      if (!busy) return this.send(wish);
      this.waiting.get(name)?.resolve(null);
      this.waiting.set(name, wish);
    });
  }

  send(wish) {
    const id = ++this.count;
    this.open.set(id, wish);
    if (!this.connection.send({ type: "request", id, name: wish.name, data: wish.data })) this.take({ id, error: "not connected to Python" });
  }

  take({ id, data, error }) {
    const wish = this.open.get(id);
    if (!wish) return void (error && this.failed(error));
    this.open.delete(id);
    const next = this.waiting.get(wish.name);
    if (next) {
      this.waiting.delete(wish.name);
      this.send(next);
    }
    if (error !== undefined) this.failed(error, wish.name);
    wish.resolve(error === undefined ? data : null);
  }

  // The connection was lost: nobody answers what is under way.
  drop() {
    const wishes = [...this.open.values(), ...this.waiting.values()];
    this.open.clear();
    this.waiting.clear();
    for (const wish of wishes) wish.resolve(null);
  }
}
