// The way to Python: a websocket that comes back by itself, and says when it is gone.

const SILENCE = 6500; // ms without a sign of life: three beats and a little
const FIRST_RETRY = 250,
  LAST_RETRY = 4000; // ms

export class Connection {
  // told(message): called with what comes as text; lost(): when the connection ends.
  constructor(url, { receive, status, told, lost }) {
    this.url = url;
    this.receive = receive;
    this.told = told;
    this.lost = lost;
    this.status = status;
    this.retry = FIRST_RETRY;
    this.open();
    setInterval(() => this.listen(), 1000);
  }

  open() {
    this.heard = Date.now();
    this.socket = new WebSocket(this.url);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = ({ data }) => {
      this.heard = Date.now();
      this.retry = FIRST_RETRY;
      this.status("");
      if (typeof data === "string") this.told?.(JSON.parse(data));
      else this.receive(data);
    };
    this.socket.onclose = () => {
      this.lost?.();
      this.status("Connection to Python lost. Reconnecting …");
      setTimeout(() => this.open(), this.retry);
      this.retry = Math.min(2 * this.retry, LAST_RETRY);
    };
  }

  listen() {
    const silent = this.socket.readyState === WebSocket.OPEN && Date.now() - this.heard > SILENCE;
    if (silent) this.status("Python is busy or gone. Waiting …");
  }

  shown(sequence) {
    this.send({ type: "shown", sequence });
  }

  // Whether it could be sent.
  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
