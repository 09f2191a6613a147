// The one WebSocket to the robot. While it is lost nothing waits to be sent but the stop.

const SILENCE_S = 3; // the node sends something every second; its own limit replaces this one
const STALLED_MS = 1000; // between two checks that are 250 ms apart
const ALIVE_MS = 1000;
const RETRY_MS = 500;
const STOP_AGAIN_MS = 250;

export class Link {
  constructor(onChange) {
    this.onChange = onChange;
    this.state = {};
    this.lost = true;
    this.connectedOnce = false;
    this.stopWaits = false;
    this.layers = [];
    this.onFrame = {};
    this.waiting = new Map();
    this.number = 0;
    this.heardMs = 0;
    this.lookedMs = performance.now();
    setInterval(() => this.look(), 250);
    setInterval(() => this.visible() && this.send({ t: "alive" }), ALIVE_MS);
    setInterval(() => this.stopWaits && this.sendStop(), STOP_AGAIN_MS);
    this.open();
  }

  visible() {
    return document.visibilityState === "visible";
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    this.openedMs = performance.now();
    socket.onopen = () => {
      this.heardMs = performance.now();
      this.state = {};
      if (this.stopWaits) this.sendStop();
      this.send({ t: "alive" });
      this.send({ t: "show", layers: this.layers });
    };
    socket.onmessage = (event) => socket === this.socket && this.receive(event.data);
    socket.onclose = () => socket === this.socket && this.lose();
  }

  receive(data) {
    this.heardMs = performance.now();
    if (this.lost) {
      this.lost = false;
      this.connectedOnce = true;
      this.onChange();
    }
    if (typeof data !== "string") return this.frame(data);
    const message = JSON.parse(data);
    if (message.t === "state") {
      this.state = { ...this.state, ...message.v };
      this.onChange();
    } else if (message.t === "answer" || message.t === "refused") {
      const resolve = this.waiting.get(message.id);
      this.waiting.delete(message.id);
      if (resolve) resolve(message);
    }
  }

  frame(data) {
    const number = new Uint8Array(data)[0];
    const layer = { 1: "costmap", 2: "obstacles", 3: "front_image", 4: "rear_image" }[number];
    const draw = this.onFrame[layer];
    if (!draw) return;
    Promise.resolve(draw(data)).finally(() =>
      requestAnimationFrame(() => this.layers.includes(layer) && this.send({ t: "ready", layer })));
  }

  look() {
    const nowMs = performance.now();
    const stalled = nowMs - this.lookedMs > STALLED_MS;
    this.lookedMs = nowMs;
    if (stalled) return; // messages that arrived meanwhile are read before the next check
    const silentMs = nowMs - Math.max(this.heardMs, this.openedMs);
    if (silentMs > 1000 * (this.state.link?.silence_s ?? SILENCE_S) && this.socket.readyState < WebSocket.CLOSING) {
      this.socket.close();
      this.lose();
    }
  }

  lose() {
    this.lost = true;
    this.state = { ...this.state, access: { role: "rider" } };
    for (const resolve of this.waiting.values()) resolve({ ok: false, why: "answer.offline" });
    this.waiting.clear();
    this.onChange();
    const gone = this.socket;
    setTimeout(() => gone === this.socket && this.open(), RETRY_MS);
  }

  // False if there is no link: it is not kept for later.
  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  ask(message) {
    const id = ++this.number;
    if (!this.send({ ...message, id })) return Promise.resolve({ ok: false, why: "answer.offline" });
    return new Promise((resolve) => this.waiting.set(id, resolve));
  }

  // Sent again until the robot has confirmed it, also after a lost link.
  stop() {
    this.stopWaits = true;
    this.sendStop();
    this.onChange();
  }

  sendStop() {
    const id = ++this.number;
    this.waiting.set(id, (answer) => {
      if (!answer.ok) return;
      this.stopWaits = false;
      this.onChange();
    });
    if (!this.send({ t: "stop", id })) this.waiting.delete(id);
  }

  show(layers) {
    if (layers.join() === this.layers.join()) return;
    this.layers = layers;
    this.send({ t: "show", layers });
  }
}
