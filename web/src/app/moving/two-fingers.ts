// Tracks two fingers on a canvas: how far they have moved together and apart, in pixels, with each move.

interface Place {
  x: number;
  y: number;
}

export class TwoFingers {
  private readonly fingers = new Map<number, Place>();

  constructor(
    canvas: HTMLElement,
    private readonly moved: (right: number, down: number, apart: number) => void,
  ) {
    canvas.addEventListener('pointerdown', ({ pointerType, pointerId, clientX: x, clientY: y }) => {
      if (pointerType === 'touch') this.fingers.set(pointerId, { x, y });
    });
    canvas.addEventListener('pointermove', ({ pointerId, clientX: x, clientY: y }) => {
      if (!this.fingers.has(pointerId)) return;
      const before = this.pair();
      this.fingers.set(pointerId, { x, y });
      const after = this.pair();
      if (before && after) this.moved(after.x - before.x, after.y - before.y, after.apart - before.apart);
    });
    for (const over of ['pointerup', 'pointercancel'] as const) {
      addEventListener(over, ({ pointerId }) => this.fingers.delete(pointerId));
    }
  }

  get areDown(): boolean {
    return this.fingers.size >= 2;
  }

  // Returns the midpoint and the distance of the first two fingers.
  private pair(): (Place & { apart: number }) | undefined {
    const [a, b] = this.fingers.values();
    return a && b && { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) };
  }
}
