// The way to Python: a websocket that comes back by itself, and says when it is gone.

const SILENCE = 6500; // ms without a sign of life: three beats and a little
const FIRST_RETRY = 250, LAST_RETRY = 4000; // ms

export class Connection {
  constructor(url, { receive, status }) {
    this.url = url;
    this.receive = receive;
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
      if (typeof data !== "string") this.receive(data);
    };
    this.socket.onclose = () => {
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
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify({ type: "shown", sequence }));
  }
}
