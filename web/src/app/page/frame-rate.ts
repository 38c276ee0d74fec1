// How fast pictures follow one another, in words. Of the first one after a rest nobody knows: what passed since the last
// animation frame is not what it takes.

export class FrameRate {
  private isDrawing = false; // in the last animation frame
  private awaited = 0; // the animation frame

  constructor(private readonly say: (text: string) => void) {}

  // A picture is drawn, in an animation frame that came so long after the last one.
  drew(milliseconds: number): void {
    if (this.isDrawing) this.say(`${inDigits(milliseconds)} ms, ${inDigits(1000 / milliseconds)} fps`);
    this.isDrawing = true;
    cancelAnimationFrame(this.awaited);
    // The next one may begin here before a picture is drawn in it; the one after that ends it.
    this.awaited = requestAnimationFrame(() => (this.awaited = requestAnimationFrame(() => this.rest())));
  }

  rest(): void {
    cancelAnimationFrame(this.awaited);
    this.isDrawing = false;
    this.say('at rest');
  }
}

export function inDigits(x: number): string {
  return x.toFixed(x < 10 ? 1 : 0);
}
