// The websocket: messages as JSON, answers as frames of bytes; of each kind only the newest answer counts.

const ARRAYS = { "<f4": Float32Array, "|i1": Int8Array, "i1": Int8Array };

export function readFrame(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  for (const { name, type, shape, place } of header.arrays) {
    const count = shape.reduce((a, b) => a * b, 1);
    arrays[name] = { data: new ARRAYS[type](buffer, 4 + length + place, count), shape };
  }
  return { header, arrays };
}

export class Talk {
  constructor(handlers) {
    this.handlers = handlers;
    this.newest = {};
    this.counter = 0;
    this.asked = {};
    this.sent = {};
    this.pending = new Set(); // kinds of which an answer is to come
    this.open();
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/talk`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = ({ data }) => this.take(data);
    this.socket.onclose = () => this.handlers.closed();
  }

  take(data) {
    if (typeof data === "string") {
      const message = JSON.parse(data), kind = message.line?.split(".")[0];
      if (message.of === undefined && kind in this.newest) message.of = kind; // a message that was none at all
      if (message.kind !== "error" || message.id === undefined || this.newest[message.of] === message.id) {
        if (message.kind === "error") this.pending.delete(message.of);
        this.handlers[message.kind](message);
        this.handlers.waiting();
      }
      return;
    }
    const { header, arrays } = readFrame(data);
    if (this.newest[header.kind] !== header.id) return;
    if (header.final !== false) this.pending.delete(header.kind);
    header.asked = this.sent[header.kind];
    header.waited = performance.now() - this.asked[header.kind];
    this.handlers[header.kind](header, arrays);
    this.handlers.waiting();
  }

  // Answers of a kind that are under way count no more.
  drop(kind) {
    this.newest[kind] = ++this.counter;
    this.pending.delete(kind);
    this.ask("stop", { what: kind }); // and what waits is told anew
  }

  ask(kind, message) {
    this.newest[kind] = ++this.counter;
    this.asked[kind] = performance.now();
    this.sent[kind] = message;
    if (kind !== "stop") this.pending.add(kind);
    if (this.socket.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify({ kind, id: this.counter, ...message }));
    }
    this.handlers.waiting();
  }
}
