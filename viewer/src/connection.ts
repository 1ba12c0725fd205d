// The way to the server: it is found again whenever it is lost.

import type { Words } from "./protocol.js";

/** Waits between attempts, milliseconds. */
const WAITS = [300, 600, 1200, 2500, 5000];

export interface Listener {
  /** Whether the server is there. */
  connected(there: boolean): void;
  words(words: Words): void;
  records(bytes: ArrayBuffer): void;
  /** All that was new has been sent: it is to be shown. More may come when it is. */
  complete(): Promise<void>;
}

export type Wish = "pause" | "resume" | "stop";

export class Connection {
  private socket: WebSocket | null = null;
  private attempts = 0;

  constructor(private readonly listener: Listener) {
    this.open();
  }

  /** Tells the server what is wanted. */
  say(wish: Wish): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(wish));
  }

  private open(): void {
    const address = new URL("stream" + location.search, location.href);
    address.protocol = address.protocol.replace("http", "ws");
    const socket = new WebSocket(address);
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.attempts = 0;
      this.listener.connected(true);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      try {
        this.take(socket, event.data);
      } catch (error) {
        // What it says next would make no more sense.
        console.error(error);
        socket.close();
      }
    };
    socket.onclose = () => {
      this.listener.connected(false);
      const wait = WAITS[Math.min(this.attempts++, WAITS.length - 1)];
      setTimeout(() => this.open(), wait);
    };
  }

  private take(socket: WebSocket, data: string | ArrayBuffer): void {
    if (typeof data === "string") {
      this.listener.words(JSON.parse(data) as Words);
    } else if (data.byteLength > 0) {
      this.listener.records(data);
    } else {
      void this.listener.complete().then(() => {
        if (socket.readyState === WebSocket.OPEN) socket.send('"ready"');
      });
    }
  }
}
